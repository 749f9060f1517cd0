"""Answer the JSON lines of `endotwin run` over TCP, for programs that cannot start a command, like Simulink.

    python tcp_server.py runs/ram_twins/policy.onnx 5555

Each connection is a stream of its own. Only programs on this machine can connect; nothing is encrypted.
"""

import socketserver
import sys

from twin.live import prepare_runtime
from twin.live.lines import answers


def tcp_server(policy: str, port: int) -> socketserver.TCPServer:
    """Return the server of a trained file; port 0 is a free one."""
    new_runtime = prepare_runtime(policy)

    class Stream(socketserver.StreamRequestHandler):
        disable_nagle_algorithm = True  # an answer is sent at once

        def handle(self) -> None:
            for answer in answers(new_runtime(0.0), self.rfile):
                self.wfile.write(f"{answer.text}\n".encode())

    socketserver.ThreadingTCPServer.allow_reuse_address = True
    socketserver.ThreadingTCPServer.daemon_threads = True  # streams end with the server
    return socketserver.ThreadingTCPServer(("127.0.0.1", port), Stream)


if __name__ == "__main__":
    with tcp_server(sys.argv[1], int(sys.argv[2])) as server:
        server.serve_forever()
