"""What a node opens to the network, and a graph on two hosts: network namespaces, each with its own /dev/shm."""
import pathlib
import signal

import pytest


def sockets(pid):
    """{(protocol, local IPv4 address)} of the internet sockets of a process."""
    inodes = {link.readlink().name for link in pathlib.Path(f'/proc/{pid}/fd').iterdir() if link.is_symlink()}
    found = set()
    for protocol in ('udp', 'udp6', 'tcp', 'tcp6', 'raw'):
        for line in pathlib.Path(f'/proc/{pid}/net/{protocol}').read_text().splitlines()[1:]:
            columns = line.split()
            if f'socket:[{columns[9]}]' in inodes:
                address = bytes.fromhex(columns[1].partition(':')[0])[::-1]
                found.add((protocol, '.'.join(map(str, address))))
    return found


@pytest.mark.parametrize('node', ['adu', 'recorder'])
def test_a_node_listens_to_its_own_machine_only(start_node, connect, node):
    alone = start_node(node)
    client = connect(alone.domain_id)
    client.until(lambda: node in client.node.get_node_names())
    assert sockets(alone.process.pid) == {('udp', '127.0.0.1')}
    alone.process.send_signal(signal.SIGINT)
    assert alone.finish(15.0).returncode == 0
