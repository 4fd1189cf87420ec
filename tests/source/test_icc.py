"""ICC profiles of stills against LittleCMS, in every way that they are embedded."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms
from stills import at_patches, encoded, ink_profile, linear_srgb, lut_profile, noise, patches

from itmo_video.colour.transfer import eotf
from itmo_video.errors import InputError
from itmo_video.source import icc
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions

PROPHOTO = np.array([[0.7977, 0.1352, 0.0313], [0.2880, 0.7119, 0.0001], [0.0, 0.0, 0.8249]])


def profile_of(primaries: str, gamma: float | None = None) -> bytes:
    return icc.matrix_profile(icc._d50_matrix(primaries), gamma)


PROFILES = {
    "srgb": (profile_of("rec709"), "srgb", "rec709"),
    "display p3": (profile_of("p3d65"), "srgb", "p3d65"),
    "adobe rgb": (profile_of("adobergb", 563 / 256), "gamma22", "adobergb"),
    "linear": (profile_of("rec709", 1.0), "linear", "rec709"),
    "rec2020 in 2.4": (profile_of("rec2020", 2.4), "bt1886", "rec2020"),
    "of no name": (icc.matrix_profile(PROPHOTO, 1.8), "srgb", "rec2020"),
    "pillow's srgb": (ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes(),
                      "srgb", "rec709"),
    "tables": (lut_profile(), "srgb", "rec2020"),
}  # fmt: skip


def by_littlecms(image: np.ndarray, profile: bytes) -> np.ndarray:
    """Linear light in Rec. 2020's primaries, of 8-bit RGB."""
    convert = ImageCms.buildTransform(
        io.BytesIO(profile), io.BytesIO(icc.rec2020_profile()), "RGB", "RGB",
        ImageCms.Intent.RELATIVE_COLORIMETRIC,
    )  # fmt: skip
    done = np.asarray(ImageCms.applyTransform(Image.fromarray(image), convert))
    return eotf(done / 255, "srgb")


def in_rec2020(path: Path) -> np.ndarray:
    from itmo_video.colour.primaries import rgb_to_rgb_matrix

    return linear_srgb(path) @ rgb_to_rgb_matrix("rec709", "rec2020").T


@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF", "WEBP", "AVIF", "HEIF"])
@pytest.mark.parametrize("name", PROFILES)
def test_profiles_agree_with_littlecms(tmp_path: Path, name: str, form: str) -> None:
    import pillow_heif

    pillow_heif.register_heif_opener()
    profile, transfer, primaries = PROFILES[name]
    by_form: dict[str, dict[str, object]] = {
        "WEBP": {"lossless": True}, "JPEG": {"quality": 100, "subsampling": 0},
        "AVIF": {"quality": 100, "subsampling": "4:4:4"}, "HEIF": {"quality": 100, "chroma": 444},
    }  # fmt: skip
    options = by_form.get(form, {})
    path = tmp_path / "a"
    path.write_bytes(encoded(patches(), form, icc_profile=profile, **options))
    encoding = open_clip(path).info.encoding
    assert (encoding.transfer, encoding.primaries) == (transfer, primaries)
    assert encoding.origins["transfer"] == encoding.origins["primaries"] == "tag"
    want = np.clip(by_littlecms(patches(), profile), 0, 1)
    got = np.clip(in_rec2020(path), 0, 1)
    lossy = form in ("JPEG", "AVIF", "HEIF")
    np.testing.assert_allclose(at_patches(got), at_patches(want), atol=0.03 if lossy else 0.008)


def test_white_of_any_profile_is_white(tmp_path: Path) -> None:
    for name, (profile, _, _) in PROFILES.items():
        path = tmp_path / "a.png"
        path.write_bytes(encoded(patches(), "PNG", icc_profile=profile))
        np.testing.assert_allclose(linear_srgb(path)[4, 4], 1, atol=1e-4, err_msg=name)


def test_sixteen_bits_stay_sixteen(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    ramp = np.tile(np.arange(1024, dtype=np.uint16)[None, :, None] * 64, (4, 1, 3))
    path = tmp_path / "a.tif"
    profile = icc.matrix_profile(PROPHOTO, 1.8)
    extra = [(34675, 7, len(profile), profile, True)]
    tifffile.imwrite(path, ramp, photometric="rgb", extratags=extra)
    got = linear_srgb(path)[0, :, 1]
    np.testing.assert_allclose(got, (np.arange(1024) * 64 / 65535) ** 1.8, atol=2e-4)
    assert len(np.unique(got)) > 1000


@pytest.mark.parametrize(("gamma", "transfer"), [
    (2.2, "gamma22"), (1.0, "linear"), (1.8, "srgb"), (None, "srgb"),
])  # fmt: skip
def test_grey_profiles(tmp_path: Path, gamma: float | None, transfer: str) -> None:
    """Grey pictures with a profile of grey, and with one of RGB as Photoshop's often have."""
    grey = noise()[..., 0]
    rgb_profile = profile_of("rec709", gamma)
    grey_profile = rgb_profile.replace(b"mntrRGB ", b"mntrGRAY").replace(b"gTRC", b"kTRC")
    want = eotf(grey / 255, "srgb") if gamma is None else (grey / 255) ** gamma
    for profile in (grey_profile, rgb_profile):
        path = tmp_path / "a.png"
        path.write_bytes(encoded(grey, "PNG", icc_profile=profile))
        assert open_clip(path).info.encoding.transfer == transfer
        np.testing.assert_allclose(linear_srgb(path)[..., 1], want, atol=3e-4)


def test_parametric_curves_of_all_kinds_agree_with_littlecms(tmp_path: Path) -> None:
    """ICC.1:2022, table 68: five kinds of the parametric curve."""
    kinds = [
        (2.0,), (2.2, 0.9, 0.1), (2.2, 0.9, 0.05, 0.05), (2.4, 0.9479, 0.0521, 0.0774, 0.0405),
        (2.4, 0.9, 0.05, 0.07, 0.04, 0.02, 0.001),
    ]  # fmt: skip
    for kind, numbers in enumerate(kinds):
        profile = bytearray(profile_of("rec709", 1.0))
        body = b"para" + bytes(4) + kind.to_bytes(2, "big") + bytes(2)
        body += b"".join(round(v * 65536).to_bytes(4, "big", signed=True) for v in numbers)
        at = len(profile)
        profile += body
        for name in (b"rTRC", b"gTRC", b"bTRC"):
            entry = profile.find(name)
            profile[entry + 4 : entry + 12] = at.to_bytes(4, "big") + len(body).to_bytes(4, "big")
        profile[:4] = len(profile).to_bytes(4, "big")
        path = tmp_path / "a.png"
        path.write_bytes(encoded(patches(), "PNG", icc_profile=bytes(profile)))
        want = by_littlecms(patches(), bytes(profile))
        np.testing.assert_allclose(
            at_patches(in_rec2020(path)), at_patches(want), atol=0.008, err_msg=str(kind)
        )


def test_damaged_profiles_are_told_and_left_out(tmp_path: Path) -> None:
    whole = profile_of("p3d65")
    path = tmp_path / "a.png"
    for bad in (b"rubbish", whole[:200], whole.replace(b"para", b"what"), whole.replace(
        b"mntrRGB ", b"mntrCMYK")):  # fmt: skip
        path.write_bytes(encoded(patches(), "PNG", icc_profile=bad))
        info = open_clip(path).info
        assert (info.encoding.transfer, info.encoding.primaries) == ("srgb", "rec709")
        assert any("profile ignored" in notice for notice in info.notices)


def test_the_users_transfer_stands_above_a_profile(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(encoded(patches(), "PNG", icc_profile=icc.matrix_profile(PROPHOTO, 1.8)))
    info = open_clip(path, InputOptions(transfer="gamma22")).info
    assert (info.encoding.transfer, info.encoding.bit_depth) == ("gamma22", 8)
    assert any("ignored" in notice for notice in info.notices)


def test_inks_with_a_profile_of_rgb_are_refused(tmp_path: Path) -> None:
    data = io.BytesIO()
    Image.new("CMYK", (8, 8)).save(data, "JPEG", icc_profile=profile_of("rec709"))
    (tmp_path / "a.jpg").write_bytes(data.getvalue())
    with pytest.raises(InputError, match="CMYK"):
        open_clip(tmp_path / "a.jpg")


@pytest.mark.parametrize("form", ["JPEG", "TIFF"])
def test_inks_are_converted_by_their_profile(tmp_path: Path, form: str) -> None:
    inks = np.zeros((16, 64, 4), np.uint8)
    for n, ink in enumerate([(0, 0, 0, 0), (128, 0, 0, 0), (40, 90, 20, 60), (0, 0, 0, 200)]):
        inks[:, 16 * n : 16 * n + 16] = ink
    options = {"quality": 100, "subsampling": 0} if form == "JPEG" else {}
    data = io.BytesIO()
    image = Image.fromarray(inks, "CMYK")
    image.save(data, form, icc_profile=ink_profile(), **options)
    (tmp_path / "a").write_bytes(data.getvalue())
    want = (1 - inks[8, 8::16, :3] / 255) * (1 - inks[8, 8::16, 3:] / 255)
    np.testing.assert_allclose(linear_srgb(tmp_path / "a")[8, 8::16], want, atol=0.02)
    assert any("CMYK" in notice for notice in open_clip(tmp_path / "a").info.notices)
