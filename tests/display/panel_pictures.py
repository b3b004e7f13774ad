"""The panels' pictures of `panel_cases` as text: the golden files. A script, and what the tests compare with.

python tests/display/panel_pictures.py              draws them anew into tests/display/panels/: look at the difference
micropython tests/display/panel_pictures.py LAYOUT  prints the same, as a microcontroller draws them, in hexadecimal
"""

import sys

if __name__ == "__main__":
    sys.path.insert(0, __file__.split("tests/display/")[0] + "dnb_edge/display")

import panel_cases


def drawn(state, face, layout):
    """Name and picture of every case, all on one surface; `state` and `face`: the panel's modules, however imported here."""
    surface = face.surface(layout)
    for name, steps, at_ms in panel_cases.CASES:
        face.draw(panel_cases.told(state.Panel(), steps), surface, at_ms)
        yield name, surface


def golden(plain, pictures):
    """The text of one layout's golden file."""
    return "\n".join(["== %s\n%s" % (name, plain(surface)) for name, surface in pictures])


def main():
    if sys.implementation.name == "micropython":
        import binascii
        import gc

        from panel import face, state

        gc.collect()
        for name, surface in drawn(state, face, sys.argv[1]):
            # In pieces, since there is no room for all of it at once on a microcontroller.
            print(name, end=" ")
            for at in range(0, len(surface.buffer), 256):
                print(binascii.hexlify(surface.buffer[at : at + 256]).decode(), end="")
            print()
        return
    from pathlib import Path

    from dnb_edge.display.panel import face, state
    from dnb_edge.display.simulator import plain

    folder = Path(__file__).parent / "panels"
    folder.mkdir(exist_ok=True)
    for layout in face.LAYOUTS:
        (folder / f"{layout}.txt").write_text(golden(plain, drawn(state, face, layout)), encoding="utf-8")


if __name__ == "__main__":
    main()
