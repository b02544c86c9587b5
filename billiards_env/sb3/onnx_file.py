"""An `AimPolicy` as an ONNX file, which other programs and languages run without PyTorch. Needs the extra `onnx`."""

from __future__ import annotations

import logging
import warnings
from os import PathLike
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from billiards_env.sb3.aim_network import Mixture
from billiards_env.support.files import check_path, replacing

if TYPE_CHECKING:
    from billiards_env.sb3.aim_policy import AimPolicy

OUTPUTS = "action", "value", *Mixture._fields
"""The outputs of the file, by name."""


class _Outputs(nn.Module):
    """The networks of a policy as a function of observations alone."""

    def __init__(self, policy: AimPolicy) -> None:
        super().__init__()
        self.policy = policy

    def forward(self, observation: Tensor) -> tuple[Tensor, ...]:
        mixture, values = self.policy.mixtures_and_values(observation)
        tip_std, turn = mixture.tip_std.expand_as(mixture.tip), mixture.turn.expand_as(values)
        return mixture.mode(), values, *mixture._replace(tip_std=tip_std, turn=turn)


def to_onnx(policy: AimPolicy, path: str | PathLike[str]) -> None:
    """Writes a policy as an ONNX file, see `AimPolicy.to_onnx`."""
    target = check_path(path, ".onnx")
    example = torch.as_tensor(policy.game.observation_space.sample()).repeat(3, 1)
    options: Any = {"dynamic_shapes": ({0: torch.export.Dim("m")},), "input_names": ["observation"]}
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)  # it names each package of torchvision that is missing
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program: Any = torch.onnx.export(
                _Outputs(policy).eval(), (example,), output_names=list(OUTPUTS), dynamo=True, verbose=False, **options
            )
    finally:
        logger.setLevel(level)
    with replacing(target) as temporary:
        program.save(temporary)
