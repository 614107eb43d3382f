"""Whatever is saved can be read again, and is, before what was there goes."""

from __future__ import annotations

import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ModelError
from auvnn.models import GreyBox, load
from auvnn.models import saving as saving_module
from auvnn.storage import read_folder, tensors_from_bytes, tensors_to_bytes, write_folder
from auvnn.storage import tensors as tensors_module


def with_header_length(wanted: int) -> tuple[dict[str, torch.Tensor], bytes]:
    """Tensors whose safetensors header has a length that begins with certain bytes (low ones first)."""
    for length in range(1, 30_000):
        given = {"x" * length: torch.arange(3.0)}
        data = tensors_to_bytes(given)
        if int.from_bytes(data[:8], "little") == wanted:
            return given, data
        if int.from_bytes(data[:8], "little") > wanted:
            break
    raise AssertionError("no such length")


@pytest.mark.parametrize("wanted", [0x80, 0x180, 0x280, 0x380, 0x480], ids=hex)
def test_a_length_that_begins_like_a_pickle_is_no_pickle(wanted):
    given, data = with_header_length(wanted)
    assert data[:1] == b"\x80"
    (name,) = given
    assert torch.equal(tensors_from_bytes(data)[name], given[name])


def test_a_length_that_begins_like_an_archive_is_none():
    given = {"x" * (0x4B50 - 58 - n): torch.arange(3.0) for n in (0,)}
    for more in range(64):
        data = tensors_to_bytes({next(iter(given)) + "y" * more: torch.arange(3.0)})
        if data[:2] == b"PK":
            assert len(tensors_from_bytes(data)) == 1
            return
    pytest.fail("no such length")


@pytest.mark.parametrize("form", ["mlp", "dissipative", "polynomial"])
@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize("hidden", [3, 5, 8])
def test_models_of_every_damping_form_are_read_again(tmp_path, form, rest, hidden):
    options = {"form": form} if form == "polynomial" else {"form": form, "hidden": hidden}
    if form == "mlp":
        options["zero_at_rest"] = rest
    known = load("rov95", actuation="wrench")
    model = GreyBox(known.vehicle, (), DampingBank.from_description(options, 0), "wrench")
    again = load(model.save(tmp_path / "model"))
    assert again.damping is not None and model.damping is not None
    for name, tensor in model.damping.state_dict().items():
        assert torch.equal(again.damping.state_dict()[name], tensor.double()), name


def test_what_cannot_be_read_again_does_not_replace_what_can(tmp_path, monkeypatch):
    model = load("rov95")
    folder = model.save(tmp_path / "model")
    before = read_folder(folder)

    def unreadable(files, path, actuation=None):
        raise ModelError("the reader has a fault")

    monkeypatch.setattr(saving_module, "_readers", [unreadable])
    with pytest.raises(ModelError, match="not saved, because it could not be read again"):
        model.save(tmp_path / "model", overwrite=True)
    assert read_folder(folder) == before and [p.name for p in tmp_path.iterdir()] == ["model"]


def test_a_disk_that_holds_something_else_is_seen(tmp_path, monkeypatch):
    from auvnn.storage import folders

    write_folder(tmp_path / "kept", {"a.txt": "first"})
    write = folders._write_flushed
    monkeypatch.setattr(
        folders, "_write_flushed", lambda path, data: write(path, data.replace(b"second", b"secund"))
    )
    with pytest.raises(ModelError, match="could not be read again"):
        write_folder(tmp_path / "kept", {"a.txt": "second"}, overwrite=True)
    assert read_folder(tmp_path / "kept") == {"a.txt": b"first"}


def test_tensors_that_come_back_changed_are_not_written(monkeypatch):
    read = tensors_module.tensors_from_bytes
    monkeypatch.setattr(
        tensors_module, "tensors_from_bytes", lambda *a, **k: {n: t + 1 for n, t in read(*a, **k).items()}
    )
    with pytest.raises(ModelError, match="cannot be read back"):
        tensors_to_bytes({"a": torch.zeros(2)})


def test_signed_zeros_infinities_and_nans_count_as_what_they_are():
    odd = torch.tensor([0.0, -0.0, float("inf"), float("nan")])
    again = tensors_from_bytes(tensors_to_bytes({"odd": odd}, finite=False), finite=False)["odd"]
    assert torch.equal(again.view(torch.int32), odd.view(torch.int32))
