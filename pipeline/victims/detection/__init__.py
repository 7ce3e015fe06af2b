"""Victim detection: YOLOv3 networks (Redmon and Farhadi, arXiv:1804.02767) that find people in the camera's image."""
