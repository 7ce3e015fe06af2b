"""Networks that classify points, with one module per network, and one trainer, sampler and file format for all.

A network's module, such as ``dgcnn``, holds the network as published and the names of its weights. ``dgcnn_cpu`` is a
faster DGCNN for inference.
"""
