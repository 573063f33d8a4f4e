"""Tests end processes by signals, which a session in the background, or under nohup, ignores and hands on."""
import signal

for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)
