"""What may stand on a panel that was told of a state of the race."""

from board_checks import as_rows

from dnb_edge.display import messages, protocol
from dnb_edge.display.panel import face
from dnb_edge.display.panel.state import Panel


def pictures_of(state, layout="matrix-32x8"):
    """Every picture of `state` in the 20 seconds behind its repaint, as texts."""
    panel, surface = Panel(), face.surface(layout)
    panel.feed(b"".join(map(protocol.encode_line, messages.repaint(state))), 0)
    pictures = set()
    for t_ms in range(0, 20000, 40):
        panel.feed(protocol.encode_line(messages.run_message(state)), t_ms)
        face.draw(panel, surface, t_ms)
        pictures.add("\n".join(as_rows(surface)))
    return pictures
