"""Records the reference recordings anew and prints the difference that is accepted with them.

    make update-references                     every reference
    python bags/reference/update.py leo_pass   only these

What the present nodes make of the inputs in the old recordings is compared with what is recorded there, field by
field; then the new recordings take their place.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile

FOLDER = pathlib.Path(__file__).parent
LARGEST = 1_000_000
SHORT = ('--pacing', 'lockstep', '--duration', '4', '--param', 'acu.tracker.lock_count=20')
"""Just long enough to lock, to hand over and to track for some seconds."""

REFERENCES = {'leo_pass': SHORT, 'uav_flyby': SHORT, 'ship_pass': SHORT, 'servo_step': (),
              'servo_sine': ('--duration', '1.5')}
"""{scenario and name of its reference: how its run is shortened}."""


def pedestal(*arguments):
    """Exit code of a `pedestal` command, its output on ours."""
    return subprocess.run([sys.executable, '-m', 'pedestal.cli', *map(str, arguments)]).returncode


def recompute(name, bag):
    """Exit code of a comparison to the last bit; a servo scenario never tracks."""
    idle = ('--allow-idle',) if name.startswith('servo_') else ()
    return pedestal('recompute', bag, '--absolute', 0, '--relative', 0, *idle)


def update(name, folder):
    """Record one reference in a folder and put it in place; 1 and the old one stays if that fails."""
    old, new = FOLDER / name, folder / name
    print(f'== {name}: pedestal run {name} {" ".join(REFERENCES[name])}', flush=True)
    if pedestal('run', name, '--bag', new, *REFERENCES[name]):
        return 1
    size = sum(file.stat().st_size for file in new.iterdir())
    if size > LARGEST:
        print(f'{name}: {size} bytes; must be at most {LARGEST}', file=sys.stderr)
        return 1
    if recompute(name, new):
        print(f'{name}: the new recording does not recompute to itself', file=sys.stderr)
        return 1
    if old.exists():
        print(f'-- accepted: what the nodes now make of the old {name}', flush=True)
        recompute(name, old)
        shutil.rmtree(old)
    shutil.move(new, old)
    print(f'-- {old}: {size} bytes', flush=True)
    return 0


def main(names):
    unknown = [name for name in names if name not in REFERENCES]
    if unknown:
        print(f'no reference {", ".join(unknown)}; there are {", ".join(REFERENCES)}', file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        return max(update(name, pathlib.Path(folder)) for name in names or REFERENCES)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
