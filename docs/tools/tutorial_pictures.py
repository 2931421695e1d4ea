"""Draw the pictures of the tutorials (or of those that are named) from what their own blocks write.

Run it after a change to a tutorial: `python docs/tools/tutorial_pictures.py [TUTORIAL …]`.
"""

import os
import sys
import tempfile
from pathlib import Path

import tutorial
from PIL import Image

DOCS = Path(__file__).parents[1]
PICTURES = {  # tutorial: {file that it writes: picture of the page}
    "size-an-arm": {"arm_sizing/over_time_reach.png": "tutorial_over_time.png"},
    "choose-the-motors": {"arm_selection/motors.png": "tutorial_motors.png"},
    "simulate-and-trust": {"scene_run/run.png": "tutorial_run.png"},
    "tolerances": {"tolerance/limits.png": "tutorial_tolerance.png"},
    "fastest": {"arm_fastest/fastest_cycle.png": "tutorial_fastest.png"},
}
WIDTH, COLOURS = 1000, 256  # pixels; few colours, so that the files are small


def main() -> None:
    """Draw them."""
    for name in sys.argv[1:] or PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            tutorial.run(DOCS / "tutorials" / f"{name}.md")
            for source, target in PICTURES[name].items():
                drawn = Image.open(source).convert("RGB")
                small = drawn.resize((WIDTH, round(drawn.height * WIDTH / drawn.width)), Image.Resampling.LANCZOS)
                path = DOCS / "pictures" / target
                small.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
                print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
            os.chdir(DOCS)


if __name__ == "__main__":
    main()
