"""The methods of recorded shots that return derivatives: `ShotResult` and `BatchResult` share them.

`billiards_env.derivatives.shot_derivatives` computes the derivatives. It is imported by the first call.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from billiards_env.derivatives.shot_derivatives import Certainty, Margins, Nonsmooth, Record


class Differentiable:
    """A recorded shot, or a batch of m recorded shots.

    For a batch all results have a leading axis m, and the bits are those of the single shots. Inputs then have this
    axis too, or not if they are the same for all shots.
    """

    __slots__ = ()

    def _record(self, method: str) -> Record:
        """Returns what the derivatives need; `method` is the caller, for the message of the ValueError."""
        raise NotImplementedError

    def _of_each(self, result: Any) -> Any:
        """Returns results with a leading axis in the form of this object."""
        return result

    def _find(self, method: str, *arguments: Any) -> Any:
        """Returns the result of the function of `derivatives.shot_derivatives` with the name of a method."""
        from billiards_env.derivatives import shot_derivatives

        return self._of_each(getattr(shot_derivatives, method)(self._record(method), *arguments))

    def jvp(
        self,
        tangents: Mapping[str, ArrayLike],
        of: str | Sequence[str] = "positions",
        *,
        t: ArrayLike | None = None,
        strike: ArrayLike | None = None,
        threads: int | None = None,
    ) -> Any:
        """Returns the Jacobian times a vector: the change of outputs that a small change of inputs causes.

        Args:
            tangents: The changes of the inputs by name, such as {"velocities": [[0.1, 0.0], [0.0, 0.0]]}.
                `derivatives.shot_derivatives` lists the inputs and the outputs with their shapes.
            of: An output, or several.
            t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot. The
                derivatives of later events are 0.
            strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
            threads: Number of threads for a batch; None for that of `set_num_threads`.

        Returns:
            The change of the output, or a dict with those of the outputs by name. There is no derivative at an event
            that `nonsmooth` reports: the result then treats impacts at one instant as successive, and neglects the
            contact-time rule.

        Raises:
            ValueError: If the shot was not recorded or not run by "pic", a name is unknown, an array has another shape,
                t is negative or not finite, or `strike` is missing, not that of the shot, a miscue, or at a ball that
                touched another one ahead of it.

        Example:
            >>> from billiards_env import Scene, simulate
            >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
            >>> shot.jvp({"velocities": [[0.0, 0.1]]}).tolist()
            [[0.0, 0.1]]
        """
        return self._find("jvp", tangents, of, t, strike, threads)

    def vjp(
        self,
        cotangents: Mapping[str, ArrayLike],
        by: str | Sequence[str] = "velocities",
        *,
        t: ArrayLike | None = None,
        strike: ArrayLike | None = None,
        threads: int | None = None,
    ) -> Any:
        """Returns a vector times the Jacobian: the gradient of a function of outputs with respect to inputs.

        Args:
            cotangents: The derivatives of the function with respect to the outputs by name.
            by: An input, or several.
            t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot.
            strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
            threads: Number of threads for a batch; None for that of `set_num_threads`.

        Returns:
            The gradient, or a dict with the gradients by name; see `jvp`.

        Raises:
            ValueError: As in `jvp`.

        Example:
            >>> from billiards_env import Scene, simulate
            >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
            >>> shot.vjp({"positions": [[3.0, 4.0]]}, by=("velocities", "mass"))
            {'velocities': array([[3., 4.]]), 'mass': array([0.])}
        """
        return self._find("vjp", cotangents, by, t, strike, threads)

    def jacobian(
        self,
        of: str = "positions",
        by: str = "velocities",
        *,
        t: ArrayLike | None = None,
        strike: ArrayLike | None = None,
        threads: int | None = None,
    ) -> Any:
        """Returns the derivative of an output with respect to an input, with the axes of `of` and then those of `by`.

        Args:
            of: An output.
            by: An input.
            t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot.
            strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
            threads: Number of threads for a batch; None for that of `set_num_threads`.

        Raises:
            ValueError: As in `jvp`.

        Example:
            >>> from billiards_env import Scene, simulate
            >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
            >>> shot.jacobian()[0, :, 0].tolist()
            [[1.0, 0.0], [0.0, 1.0]]
        """
        return self._find("jacobian", of, by, t, strike, threads)

    def nonsmooth(self, t: ArrayLike | None = None, threads: int | None = None) -> Nonsmooth:
        """Returns the first event at which the shot has no derivative, with the reason, see `Nonsmooth`.

        Args:
            t: Time until which the shot counts, s, or (m,) times; None for its end.
            threads: Number of threads for a batch; None for that of `set_num_threads`.

        Raises:
            ValueError: If the shot was not recorded or not run by "pic", or t is negative or not finite.
        """
        return self._find("nonsmooth", t, threads)

    def certainty(self) -> Certainty:
        """Returns the number of certain contacts and whether the outcome is certain, see `Certainty`.

        Raises:
            ValueError: If the shot was not recorded, or was not computed by "pic".

        Example:
            >>> from billiards_env import Scene, simulate
            >>> shot = simulate(Scene.named("pool"), [[-0.5, 0.0], [0.0, 0.01]], [2.0, 0.0], record=True)
            >>> shot.certainty().outcome
            True
        """
        return self._find("certainty")

    def margins(self, t: ArrayLike | None = None, threads: int | None = None) -> Margins:
        """Returns the signed distances to changes of outcome: of balls to balls, to pockets and to cushions.

        Their derivatives are `shot.jacobian("pocket_margins", "velocities")`, and the same of "ball_margins" and
        "cushion_margins".

        Args:
            t: Time until which the shot counts, s, or (m,) times; None for its end.
            threads: Number of threads for a batch; None for that of `set_num_threads`.

        Raises:
            ValueError: If the shot was not recorded or not run by "pic", or t is negative or not finite.

        Example:
            >>> from billiards_env import Scene, simulate
            >>> scene = Scene.named("ideal")  # balls of 28.575 mm: the cue ball passes at a gap of 3 mm
            >>> shot = simulate(scene, [[-0.5, 0.06015], [0.0, 0.0]], [1.0, 0.0], max_time=0.9, record=True)
            >>> round(float(shot.margins().balls[0, 1]), 6)
            -0.003
        """
        return self._find("margins", t, threads)
