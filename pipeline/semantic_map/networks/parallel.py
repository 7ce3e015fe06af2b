"""Training in several processes: in each step, every process started by ``torchrun`` learns from its own batch."""

import os
from dataclasses import dataclass

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel


@dataclass(frozen=True)
class TrainingWorker:
    """This process among those that train together.

    Attributes:
        rank: number of this process; process 0 validates and writes.
        count: number of processes.
        device: device that it computes on.
    """

    rank: int
    count: int
    device: torch.device

    @classmethod
    def join(cls) -> "TrainingWorker":
        """This process with its rank from torchrun, or as the only one; on its own GPU if there are GPUs."""
        rank, count = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
        device = torch.device("cpu")
        if torch.cuda.is_available():
            device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))
            torch.cuda.set_device(device)
        if count > 1:
            distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
        return cls(rank, count, device)

    @classmethod
    def alone(cls) -> "TrainingWorker":
        """This process as the only one, on a GPU if there is one."""
        return cls(0, 1, torch.device("cuda" if torch.cuda.is_available() else "cpu"))

    @property
    def leads(self) -> bool:
        """Whether this process is the one that validates and writes."""
        return self.rank == 0

    def share(self, module: nn.Module) -> nn.Module:
        """The module, wrapped to average its gradients over all workers."""
        return DistributedDataParallel(module) if self.count > 1 else module

    def agreed(self, value: float) -> float:
        """Process 0's value, in every process."""
        shared = torch.tensor(value, dtype=torch.float64, device=self.device)
        if self.count > 1:
            distributed.broadcast(shared, 0)
        return float(shared)

    def wait(self) -> None:
        """Wait until process 0 calls this.

        Process 0 only sends: after a barrier, a process that leaves at once can interrupt another's last receive.
        """
        self.agreed(0.0)

    def random_state(self) -> list[torch.Tensor]:
        """The state of PyTorch's random number generators on the CPU and, if used, on the GPU."""
        on_gpu = [torch.cuda.get_rng_state(self.device)] if self.device.type == "cuda" else []
        return [torch.get_rng_state(), *on_gpu]

    def set_random_state(self, state: list[torch.Tensor]) -> None:
        """Restore a state returned by :meth:`random_state`."""
        torch.set_rng_state(state[0].cpu())
        for on_gpu in state[1:] if self.device.type == "cuda" else ():
            torch.cuda.set_rng_state(on_gpu.cpu(), self.device)

    def leave(self) -> None:
        """Leave the group of processes."""
        if self.count > 1:
            distributed.destroy_process_group()
