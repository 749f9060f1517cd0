"""Cells: what networks remember from sample to sample, each as one step on (B, size) numbers.

A memory of zeros is that of a cell that has seen nothing.
"""

import torch

Tensor = torch.Tensor


class MemoryCell(torch.nn.Module):
    """A step of a memory.

    Attributes:
        size: numbers that are remembered.
        width: numbers that are said.
    """

    size: int
    width: int

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return (B, width) what it says of (B, n) numbers, and its (B, size) memory after them."""
        raise NotImplementedError


class GatedUnit(MemoryCell):
    """Gated recurrent unit (Cho et al. 2014)."""

    def __init__(self, inputs: int, width: int):
        super().__init__()
        self.size = self.width = width
        self.cell = torch.nn.GRUCell(inputs, width)

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return what it says, and what it remembers."""
        memory = self.cell(seen, memory)
        return memory, memory


class LongShortTerm(MemoryCell):
    """Long short-term memory (Hochreiter and Schmidhuber 1997)."""

    def __init__(self, inputs: int, width: int):
        super().__init__()
        self.size, self.width = 2 * width, width
        self.cell = torch.nn.LSTMCell(inputs, width)

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return what it says, and what it remembers."""
        hidden, cell = self.cell(seen, memory.split(self.width, dim=1))
        return hidden, torch.cat([hidden, cell], dim=1)


class StateSpace(MemoryCell):
    """Selective diagonal state space (after Mamba, Gu and Dao 2023): step, input and output by what is seen.

    Each of W channels u has N states with decay rates a > 0: h <- exp(-dt a) h + dt b u, says c . h + d u.
    """

    def __init__(self, inputs: int, width: int, states: int = 8):
        super().__init__()
        self.size, self.width, self.states = width * states, width, states
        self.channels = torch.nn.Linear(inputs, width)
        self.gate = torch.nn.Linear(inputs, width)
        self.step = torch.nn.Linear(width, width)
        self.into = torch.nn.Linear(width, states)
        self.out = torch.nn.Linear(width, states)
        self.log_rate = torch.nn.Parameter(torch.log(torch.arange(1.0, states + 1)).repeat(width))
        self.skip = torch.nn.Parameter(torch.ones(width))
        # States are flat, channel by channel: files of ours have no operator that shapes anew.
        self.of_channel = torch.nn.Buffer(torch.eye(width).repeat_interleave(states, dim=1))
        self.of_state = torch.nn.Buffer(torch.eye(states).repeat(1, width))
        with torch.no_grad():
            self.step.bias.uniform_(-6.0, -1.0)  # memories from a sample to some hundred

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return what it says, and what it remembers."""
        raw, gate = self.channels(seen), self.gate(seen)
        channel = raw * torch.sigmoid(raw)
        step = torch.sigmoid(self.step(channel))
        into, out = self.into(channel) @ self.of_state, self.out(channel) @ self.of_state
        decay = torch.exp(-(step @ self.of_channel) * torch.exp(self.log_rate))
        states = decay * memory + ((step * channel) @ self.of_channel) * into
        said = (states * out) @ self.of_channel.T + self.skip * channel
        return said * gate * torch.sigmoid(gate), states


class Convolution(MemoryCell):
    """Causal temporal convolution (Bai et al. 2018): layers of two taps, each twice as far apart as before.

    The memory holds the inputs of each layer that are still needed, the oldest first.
    """

    def __init__(self, inputs: int, width: int, layers: int = 6):
        super().__init__()
        self.width = width
        self.apart = [2**layer for layer in range(layers)]
        self.size = width * sum(self.apart)
        self.before = torch.nn.Linear(inputs, width)
        self.now = torch.nn.ModuleList(torch.nn.Linear(width, width) for _ in range(layers))
        self.then = torch.nn.ModuleList(torch.nn.Linear(width, width, bias=False) for _ in range(layers))

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return what it says, and what it remembers."""
        said, kept = torch.tanh(self.before(seen)), []
        sizes = [size for apart in self.apart for size in (self.width, self.width * (apart - 1)) if size]
        parts = iter(memory.split(sizes, dim=1))
        for now, then, apart in zip(self.now, self.then, self.apart, strict=True):
            oldest = next(parts)
            kept += [next(parts), said] if apart > 1 else [said]
            said = said + torch.tanh(now(said) + then(oldest))
        return said, torch.cat(kept, dim=1)
