"""Parameters of `pipeline.contacts`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class ContactParams:
    """When a whisker touches, and what is odd about a contact."""

    gap_scale_mm: quantity(0.01, 50, "mm") = parameter(
        1.0, "typical gap between whisker and pole of a free frame", "chosen"
    )
    force_scale_uN: quantity(0.01, 10000, "µN") = parameter(
        8.0, "typical force of a touching frame", "chosen for mice"
    )
    starts_per_s: quantity(0.01, 1000, "1/s") = parameter(
        10.0, "contacts that begin, per second of free whisking", "chosen"
    )
    ends_per_s: quantity(0.01, 1000, "1/s") = parameter(
        30.0, "contacts that end, per second of contact",
        "literature: a mean duration of 30.9 ms (Hires et al. 2013)",
    )  # fmt: skip
    near_pole_mm: quantity(0.01, 5, "mm") = parameter(
        0.2, "it is no contact if the whisker is farther from the pole in half of it", "chosen"
    )
    pole_error_mm: quantity(0.01, 5, "mm") = parameter(
        0.16, "the pole's surface is not farther from where it was measured", "chosen"
    )
    least_gap_sd_mm: quantity(0.0001, 1, "mm") = parameter(
        0.0016, "least standard error of the gap", "chosen: 0.04 px at 25 px/mm"
    )
    traced_gap_sd_mm: quantity(0.0001, 1, "mm") = parameter(
        0.016, "standard error of the traced gap where no rod was fitted",
        "chosen: 0.4 px at 25 px/mm",
    )  # fmt: skip
    slip_s: quantity(0.0005, 1, "s") = parameter(
        0.004, "time after a contact in which the pole on the other side means a slip", "chosen"
    )
    near_curvature_mm: quantity(0, 20, "mm") = parameter(
        1.0, "contacts less far beyond the curvature's place are flagged", "chosen"
    )
    large_deflection_deg: quantity(1, 89, "°") = parameter(
        34.4, "tilt of the force against the follicle's normal that is flagged", "chosen"
    )
    unlike_rod: quantity(1, 1000, "ratio") = parameter(
        4.0, "χ² under load over that of free frames that is flagged", "chosen"
    )
    contradicted_mm: quantity(0.01, 5, "mm") = parameter(
        0.3, "correction of the hidden length by the bending that is flagged",
        "chosen: 2.5 standard errors of a hidden length",
    )  # fmt: skip
