"""Networks that classify points: one module a network, one trainer, sampler and file format for all.

A network module, as ``dgcnn``, holds the network as published and the names of its weights. ``dgcnn_cpu`` computes it
faster; of that ``threads``, ``training_norm``, ``Linear`` and ``LargestLinear`` serve any network on points.
"""
