"""Networks that classify points: one module per network; one trainer, sampler and file format for all.

A network's module, such as ``dgcnn``, holds the network as published and the names of its weights. ``dgcnn_cpu`` is a
faster DGCNN for inference.
"""
