# docker build --tag sarsim . && docker run --rm --volume "$PWD/runs:/sarsim/runs" sarsim
FROM debian:13-slim
# hadolint ignore=DL3008 # any make will do
RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/*
WORKDIR /sarsim
COPY Makefile pyproject.toml setup.py requirements.txt README.md LICENSE ./
COPY scripts scripts
COPY assets assets
COPY pipeline pipeline
COPY sarsim sarsim
RUN make setup && rm -rf /var/lib/apt/lists/* /root/.cache
# Without the live page, whose port nobody outside the container could reach.
CMD [".venv/bin/python", "scripts/run_episode.py"]
