"""The networks once more, from the papers' equations with plain loops over points, in float64, without PyTorch."""

import numpy as np


def weights_of(network):
    return {name: tensor.numpy().astype(np.float64) for name, tensor in network.state_dict().items()}


def norm(w, name, x):
    mean, variance, gamma, beta = (w[f"{name}.{part}"] for part in ("running_mean", "running_var", "weight", "bias"))
    return (x - mean) / np.sqrt(variance + 1e-5) * gamma + beta


def linear(w, name, x):
    return x @ w[f"{name}.weight"].T + w.get(f"{name}.bias", 0)


def mlp(w, name, x):
    layer = 0
    while f"{name}.{layer}.weight" in w:
        x = np.maximum(norm(w, f"{name}.{layer + 1}", linear(w, f"{name}.{layer}", x)), 0)
        layer += 3
    return x


def elu(x):
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def dense(w, name, x):
    return norm(w, f"{name}.2", elu(linear(w, f"{name}.0", x)))


# PointNet


def transform(w, name, x, size):
    of_points = np.stack([mlp(w, f"{name}.points", row) for row in x])
    return linear(w, f"{name}.matrix", mlp(w, f"{name}.block", of_points.max(axis=0))).reshape(size, size)


def pointnet(w, x):
    turn = transform(w, "turn", x, 3)
    local = np.stack([mlp(w, "points1", np.append(row[:3] @ turn, row[3:])) for row in x])
    matrix = transform(w, "transform", local, 64)
    local = np.stack([row @ matrix for row in local])
    everything = np.stack([mlp(w, "points2", row) for row in local]).max(axis=0)
    return np.stack([linear(w, "classifier", mlp(w, "head", np.append(row, everything))) for row in local])


# PointNet++ and PointNeXt


def samples(positions, share):
    """The first is the farthest from the mean; each other one the farthest from those before."""
    chosen = [int(np.argmax([np.linalg.norm(p - positions.mean(axis=0)) for p in positions]))]
    while len(chosen) < np.ceil(share * len(positions) - 1e-9):
        chosen.append(int(np.argmax([min(np.linalg.norm(p - positions[c]) for c in chosen) for p in positions])))
    return chosen


def ball(positions, centre, radius, most):
    distance = np.linalg.norm(positions - centre, axis=1)
    return [j for j in np.argsort(distance) if distance[j] < radius][:most]


def interpolate(positions, features, place):
    distance = np.linalg.norm(positions - place, axis=1)
    near = np.argsort(distance)[:3]
    weight = 1 / (distance[near] ** 2 + 1e-8)
    return (weight[:, None] * features[near]).sum(axis=0) / weight.sum()


def upwards(w, clouds):
    """Feature propagation from the coarsest of the clouds to the finest."""
    positions, x = clouds[-1]
    for level, (finer, own) in enumerate(reversed(clouds[:-1])):
        rows = [np.append(interpolate(positions, x, p), f) for p, f in zip(finer, own, strict=True)]
        positions, x = finer, np.stack([mlp(w, f"up.{level}.layers", row) for row in rows])
    return np.stack([linear(w, "classifier", mlp(w, "head", row)) for row in x])


def pointnet2(w, x):
    clouds = [(x[:, :3], x)]
    for level, radius in enumerate((0.1, 0.2, 0.4, 0.8)):
        positions, features = clouds[-1]
        chosen = samples(positions, 0.25)
        rows = []
        for c in chosen:
            near = ball(positions, positions[c], radius, 32)
            edges = [np.append(positions[j] - positions[c], features[j]) for j in near]
            rows.append(np.max([mlp(w, f"down.{level}.layers", edge) for edge in edges], axis=0))
        clouds.append((positions[chosen], np.stack(rows)))
    clouds[0] = (x[:, :3], x[:, :0])
    return upwards(w, clouds)


def pointnext(w, x):
    clouds = [(x[:, :3], linear(w, "stem", x))]
    for level, radius in enumerate((0.1, 0.2, 0.4, 0.8)):
        positions, features = clouds[-1]
        chosen, name = samples(positions, 0.25), f"down.{level}"
        rows = []
        for c in chosen:
            near = ball(positions, positions[c], radius, 32)
            edges = [np.append((positions[j] - positions[c]) / radius, features[j]) for j in near]
            hidden = [np.maximum(norm(w, f"{name}.layers.1", linear(w, f"{name}.layers.0", e)), 0) for e in edges]
            around = np.max([norm(w, f"{name}.layers.4", linear(w, f"{name}.layers.3", h)) for h in hidden], axis=0)
            rows.append(np.maximum(around + linear(w, f"{name}.own", features[c]), 0))
        clouds.append((positions[chosen], np.stack(rows)))
    return upwards(w, clouds)


# PointCNN


def depthwise(weight, x):
    channels, k, depth = weight.shape
    return np.array([sum(x[j, c] * weight[c, j, m] for j in range(k)) for c in range(channels) for m in range(depth)])


def xconv(w, name, k, dilation, cloud, centres):
    """Algorithm 1 for every centre."""
    positions, features = cloud
    rows = []
    for centre in centres:
        order = np.argsort(np.linalg.norm(positions - centre, axis=1))[: k * dilation]
        near = np.resize(order, k * dilation)[::dilation]  # again from the nearest where there are too few
        offsets = positions[near] - centre
        lifted = dense(w, f"{name}.lift.1", dense(w, f"{name}.lift.0", offsets))
        f = np.concatenate([lifted, features[near]], axis=1)
        x = dense(w, f"{name}.x0", offsets.ravel()).reshape(k, k)
        x = norm(w, f"{name}.x1.2", elu(depthwise(w[f"{name}.x1.0.weight"], x))).reshape(k, k)
        x = norm(w, f"{name}.x2.1", depthwise(w[f"{name}.x2.0.weight"], x)).reshape(k, k)
        rows.append(dense(w, f"{name}.pointwise", depthwise(w[f"{name}.depthwise.weight"], x @ f)))
    return np.stack(rows)


def pointcnn(w, x):
    cloud, levels = (x[:, :3], dense(w, "features", x[:, 3:])), []
    for level, (k, dilation, share) in enumerate(((8, 1, 1), (12, 2, 3 / 8), (16, 2, 1 / 2), (16, 6, 1 / 3))):
        centres = cloud[0] if share == 1 else cloud[0][samples(cloud[0], share)]
        features = xconv(w, f"down.{level}", k, dilation, cloud, centres)
        if level == 3:
            where = dense(w, "where.1", dense(w, "where.0", centres))
            features = np.concatenate([where, features], axis=1)
        cloud = (centres, features)
        levels.append(cloud)
    for number, (k, dilation, to) in enumerate(((16, 6, 2), (12, 6, 1), (8, 6, 0), (8, 4, 0))):
        finer, own = levels[to]
        brought = xconv(w, f"up.{number}", k, dilation, cloud, finer)
        cloud = (finer, dense(w, f"fuse.{number}", np.concatenate([brought, own], axis=1)))
    return linear(w, "classifier", dense(w, "head.1", dense(w, "head.0", cloud[1])))


# DGCNN


def leaky_mlp(w, name, layers, x):
    for layer in layers:
        x = norm(w, f"{name}{layer}.1", linear(w, f"{name}{layer}.0", x))
        x = np.maximum(x, 0.2 * x)
    return x


def dgcnn(w, x):
    graph, rows, levels = x[:, -3:], x, []
    for conv, layers in (("edge_conv1", "01"), ("edge_conv2", "01"), ("edge_conv3", "0")):
        convolved = []
        for i, place in enumerate(graph):
            near = np.argsort(np.linalg.norm(graph - place, axis=1))[:20]
            edges = [np.append(rows[j] - rows[i], rows[i]) for j in near]
            convolved.append(np.max([leaky_mlp(w, f"{conv}.layers.", layers, edge) for edge in edges], axis=0))
        graph = rows = np.stack(convolved)
        levels.append(rows)
    local = np.concatenate(levels, axis=1)
    everything = leaky_mlp(w, "embedding", [""], local).max(axis=0)
    heads = [leaky_mlp(w, "head2", [""], leaky_mlp(w, "head1", [""], np.append(everything, row))) for row in local]
    return linear(w, "classifier", np.stack(heads))
