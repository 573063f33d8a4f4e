"""Proof of the recording of a pass: a process of its own verifies the bag and writes its report, so that the station
does not wait. It prints one line of JSON, {"complete": ..., "text": ...}."""
import json
import os
import pathlib
import sys
from collections.abc import Sequence

NICENESS = 10  # of this process: the antenna comes first


def prove(bag: pathlib.Path) -> tuple[bool, str]:
    """Verify a bag and write its report; return (True if the bag is complete, text). Raises BagError, OSError,
    ValueError."""
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    from pedestal_results.report import page
    check = verify(load(bag))
    problems = [*check.problems, *(f'{topic.name}: {problem}' for topic in check.topics
                                   for problem in topic.problems)]
    report = page.write(bag)
    found = 'complete' if check.complete else f'NOT complete: {problems[0]}'
    return check.complete, f'{bag}: {found}, {report.name}'


def main(arguments: Sequence[str] | None = None) -> int:
    """Prove the bag of the first argument."""
    os.nice(NICENESS)
    bag = pathlib.Path((sys.argv[1:] if arguments is None else arguments)[0])
    try:
        complete, text = prove(bag)
    except (ValueError, OSError, RuntimeError) as error:
        complete, text = False, f'{bag}: no report: {error}'
    print(json.dumps({'complete': complete, 'text': text}), flush=True)
    return 0 if complete else 1


if __name__ == '__main__':
    sys.exit(main())
