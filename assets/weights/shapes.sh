#!/bin/sh
# How shapes.safetensors was made: four datasets, the generation of the first three stopped at so many scenes, and two
# trainings, the first of commit 667b9c47, when squares were moved less, whose weights' mean it is, calibrated as the trainings are. "usual" are arenas as the robot is measured in:
# they say how frequent things are among what stands out, and are what the trainings are validated on.
set -e
git checkout a7ebd164  # the last commit with the training program

dataset() { # NAME SCENES FRAMES SEED THINGS FLAGS
  echo "random: {things: $5}" > data/$1.yaml
  python scripts/generate_dataset.py --harder --config data/$1.yaml --out data/$1 --scenes $2 --frames $3 --seed $4 $6
}
mkdir -p data
dataset rooms 47 30 1077 "[14, 35]" "--random.furniture 0 0.35 --random.furnished 0 0.2 --random.painted 0.3 --random.victims 0 4"
dataset things 32 30 2077 "[100, 100]" "--random.tiles 3 5 --random.painted 0.3 --random.victims 0 2"
dataset people 17 25 4077 "[7, 14]" "--random.tiles 7 7 --random.ramps 0.1 0.2 --random.victims 7 9"
dataset usual 15 40 3077 "[14, 14]" "--random.tiles 6 7 --random.victims 3 3"
echo "usual: [data/usual]" > data/shapes.yaml
python scripts/train.py shapes --config data/shapes.yaml --data data/rooms data/things --steps 700 --out first.safetensors
python scripts/train.py shapes --config data/shapes.yaml --data data/things data/people --init first.safetensors \
  --seed 1 --steps 400 --out second.safetensors
