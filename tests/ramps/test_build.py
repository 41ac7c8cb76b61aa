from pathlib import Path

import pytest
from test_ramp import NAMES, copy_with

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.ramps.build import build, netconvert


@pytest.mark.parametrize("name", NAMES)
def test_shipped_nets_are_what_their_sources_build(tmp_path: Path, name: str) -> None:
    folder = copy_with(tmp_path, "title", "title", name)
    committed = (folder / f"{name}.net.xml").read_bytes()
    assert build(folder).read_bytes() == committed
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        p.name for p in (shipped("sumo_nets") / name).iterdir()
    )


def test_what_netconvert_refuses_is_one_line(tmp_path: Path) -> None:
    folder = copy_with(tmp_path, "title", "title", "designed")
    (folder / "designed.edg.xml").write_text("<edges><edge id='main_in' from='nowhere' to='gore'/></edges>")
    with pytest.raises(UserError, match=r"designed.netccfg: netconvert refuses it: .*nowhere") as caught:
        build(folder)
    assert "\n" not in str(caught.value)
    (folder / "designed.netccfg").unlink()
    with pytest.raises(UserError, match="0 files"):
        build(folder)


@pytest.mark.parametrize("name", NAMES)
def test_the_sources_keep_to_sumos_schemas(tmp_path: Path, name: str) -> None:
    """The root elements name the schemas, so that netconvert validates the files; a wrong attribute is refused."""
    folder = copy_with(tmp_path, "title", "title", name)
    options = ("--xml-validation", "local", "-o", str(tmp_path / "out.net.xml"))
    netconvert(folder, "-c", str(folder / f"{name}.netccfg"), *options)
    nodes = folder / f"{name}.nod.xml"
    nodes.write_text(nodes.read_text(encoding="utf-8").replace(' type="', ' tpye="'), encoding="utf-8")
    with pytest.raises(UserError, match="attribute 'tpye' is not declared"):
        netconvert(folder, "-c", str(folder / f"{name}.netccfg"), *options)
