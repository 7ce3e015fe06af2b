#!/bin/sh
# How shapes.safetensors was made: four datasets, the generation of the first three stopped at so many scenes, and two
# trainings, the first of commit 667b9c47, when squares were moved less, whose weights' mean it is. "usual" are arenas as the robot is measured in:
# they say how frequent things are among what stands out, and are what the trainings are validated on.
set -e

python scripts/generate_dataset.py --out data/rooms --scenes 47 --frames 30 --seed 1077 --random.things 14 35 \
  --random.furniture 0 0.35 --random.furnished 0 0.2 --random.painted 0.3 --random.victims 0 4
python scripts/generate_dataset.py --out data/things --scenes 32 --frames 30 --seed 2077 --random.tiles 3 5 \
  --random.things 100 100 --random.painted 0.3 --random.victims 0 2
python scripts/generate_dataset.py --out data/people --scenes 17 --frames 25 --seed 4077 --random.tiles 7 7 \
  --random.ramps 0.1 0.2 --random.things 7 14 --random.victims 7 9
python scripts/generate_dataset.py --out data/usual --scenes 15 --frames 40 --seed 3077 --random.tiles 6 7 \
  --random.things 14 14 --random.victims 3 3
python scripts/train.py shapes --data data/rooms data/things --usual data/usual --steps 700 --out first.safetensors
python scripts/train.py shapes --data data/things data/people --usual data/usual --init first.safetensors --seed 1 \
  --steps 400 --out second.safetensors
