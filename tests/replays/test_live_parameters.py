"""Parameters of a scene on the page of its sizing: what it computes with other lengths, masses and springs is what
Python computes with them, in the view too.
"""

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.files import bundled_data
from bellcrank.replays.film.sizing_film import film_of_sizing
from bellcrank.sizing.live.live_sizing import live_sizing
from tests.replays.test_live_sizing import NO_VIEW, compare, found_of, overrides_of, page_of

pytest_plugins = ("browser",)


def written(name, folder, **changes):
    """The file of a bundled configuration with changes."""
    data = yaml.safe_load((bundled_data.folder("robots") / f"{name}.yaml").read_text()) | changes
    data["urdf"] = str(bundled_data.folder("urdf") / f"{data['urdf']}.urdf")
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def five_bar(folder, **changes):
    """A five-bar whose lengths, payload and spring are parameters."""
    return written(
        "five_bar", folder,
        payloads=[{"mass": 0.1, "frame": "tool"}],
        forces=[{"name": "pull", "kind": "joint_spring", "joint": "left_elbow", "stiffness": 0.02}],
        parameters={
            "proximal": {"value": 0.09, "sets": ["joint.left_elbow.origin.x"]},
            "distal": {"value": 0.09, "sets": ["frame.right_tip.origin.x"]},
            "load": {"value": 0.1, "sets": ["link.payload 1.mass"]},
            "stiffness": {"value": 0.02, "sets": ["force.pull.stiffness"]},
        },
        **changes,
    )  # fmt: skip


def circling(folder):
    """A balanced arm whose tip follows a circle."""
    circle = {"kind": "circle", "frame": "tip", "center": [1.2, 1.2, 0], "radius": 0.2, "duration": 5}
    return written("balanced_arm", folder, motions={"circle": {**circle, "start": {"elbow": -1.0}}})


SCENES = {
    "balanced_arm": lambda folder: "balanced_arm", "four_bar": lambda folder: "four_bar", "five_bar": five_bar,
    "circling": circling,
}  # fmt: skip


def parameters_of(settings):
    return [k for k, one in enumerate(settings) if one["group"] == "parameters"]


# ---- without a browser


def fixed_and_free(path):
    found = live_sizing(bc.size(path))
    return found.fixed, [one.name for one in found.settings if one.group == "parameters"]


def test_parameters_of_a_scene_are_settings_or_it_is_said_why_not(tmp_path):
    assert fixed_and_free("balanced_arm") == ((), ["spring_preload", "spring_stiffness", "upper_arm"])
    assert fixed_and_free("planar_2r_tracking") == (("parameter mass_error does not change a sizing",), [])
    fixed, free = fixed_and_free(circling(tmp_path))
    assert "with another upper_arm motion circle keeps the positions of its joints" in fixed[0] and "upper_arm" in free
    names = [one.name for one in live_sizing(bc.size(five_bar(tmp_path))).settings]
    assert names[:5] == ["proximal", "distal", "load", "stiffness", "centre x"]  # a mass that a parameter sets is one


def test_lengths_of_a_linkage_whose_tool_follows_a_path_keep_their_values(tmp_path):
    line = {"kind": "line", "frame": "tool", "end": [0.0, 0.13, 0], "duration": 0.5, "coordinates": ["x", "y"]}
    fixed, free = fixed_and_free(five_bar(tmp_path, motions={"line": line}))
    assert free == ["load", "stiffness"]
    assert [one.split()[1] for one in fixed] == ["proximal", "distal"] and "changes the motion" in fixed[0]


def test_joints_from_which_the_others_of_a_linkage_follow():
    linkage = Linkage(bc.load_scene("four_bar"))
    assert linkage.leading("unfold") == ("crank",)
    assert linkage.leading("another") is None


# ---- in a browser


@pytest.fixture(scope="module", params=SCENES)
def live_page(request, open_page, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    scene = SCENES[request.param](folder)
    return scene, open_page(page_of(bc.size(scene), folder), size=(1280, 800), script=NO_VIEW)


@pytest.mark.tier2
class TestAgainstPython:
    @pytest.mark.parametrize("seed", range(8))
    def test_random_parameters_give_what_python_gives_or_are_refused_as_in_python(self, live_page, seed):
        scene, page = live_page
        page.do("b.live.reset()")
        assert page.do("b.live.agreement") < 1e-6
        rng, values = np.random.default_rng(seed), page.do("b.live.values")
        spread = 0.4 if seed < 4 else 0.06
        changes = [
            [k, values[k] * rng.uniform(1 - spread, 1 + spread)] for k in parameters_of(page.do("b.live.settings"))
        ]
        accepted = page.do("b.live.set(x)", changes)
        settings = page.do("b.live.settings")
        overrides = {settings[k]["path"]: value for k, value in changes}
        if not accepted:
            message = page.do("b.live.message")
            assert "the linkage cannot be assembled" in message and "the last values are kept" in message
            assert page.do("b.live.values") == values
            with pytest.raises(bc.BellcrankError):
                bc.size(scene, overrides=overrides)
        else:
            assert overrides_of(page) == overrides
            compare(found_of(page), bc.size(scene, overrides=overrides))
        assert page.clean

    def test_extremes_are_computed_or_refused_with_a_sentence(self, live_page):
        _, page = live_page
        page.do("b.live.reset()")
        stored = page.do("b.live.result.figures")
        for k in parameters_of(page.do("b.live.settings")):
            for value in (1e9, -1e9, 5e-324, 0.0):
                page.do("b.live.reset()")
                if not page.do("b.live.set([[x[0], x[1]]])", [k, value]):
                    assert "the last values are kept" in page.do("b.live.message")
                assert np.isfinite(np.array(page.do("b.live.result.figures"), dtype=float)).all()
                assert sum(page.do("b.live.samples")) < 60_000
        page.do("b.live.reset()")
        assert page.do("b.live.result.figures") == stored
        text = page.tab.locator("#live-panel").inner_text()
        assert "NaN" not in text and "Infinity" not in text and page.clean


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("name", "changes"),
    [("balanced_arm", {"upper_arm": 1.3}), ("four_bar", {"coupler_length": 1.4, "rocker_length": 1.4})],
)
def test_bodies_are_drawn_where_the_changed_lengths_put_them(open_page, tmp_path, name, changes):
    page = open_page(page_of(bc.size(name), tmp_path))
    stored = [page.do("b.seek(x), b.pose(1)", t) for t in (0.7, 2.5)]
    settings = page.do("b.live.settings")
    assert page.do("b.live.set(x)", [[k, changes[s["name"]]] for k, s in enumerate(settings) if s["name"] in changes])
    film = film_of_sizing(bc.size(name, overrides=changes))
    bound = 2.0 * film.error_bound + 1e-6
    times = film.time[[0, len(film.time) // 3, len(film.time) // 2, -1]]
    for t in times:
        row = int(np.searchsorted(film.time, t))
        page.do("b.seek(x)", float(t))
        for body in range(len(film.bodies)):
            np.testing.assert_allclose(page.do("b.pose(x)", body)[:3], film.poses[row, body, :3], atol=bound)
    page.do("b.live.reset()")
    assert [page.do("b.seek(x), b.pose(1)", t) for t in (0.7, 2.5)] == stored and page.clean
