"""Everything that is measured on one beam's recording, as one dictionary."""
from pedestal_bringup.analysis import consistency, isolation, known_attitude, results


def of_beam(bag) -> dict:
    """{metric: (value, unit)} of a Bag as one beam sees it (Bag.view)."""
    tracked = results.tracking(bag)
    return {**results.summary(tracked), **consistency.summary(consistency.read(bag, tracked)),
            **results.announced_losses(bag), **isolation.summary(isolation.read(bag, tracked)),
            **known_attitude.summary(known_attitude.read(bag))}
