"""USD crates: what `supple export --mesh usd` writes as text, in binary and frame by frame. Needs the package usd-core.

    from supple import usd

    usd.crate("out/two_balls/two_balls.usda")    # two_balls.usdc: one file
    usd.clips("out/two_balls/two_balls.usda")    # two_balls.usd with one crate per frame (value clips)

Clips let a program read the frames that it shows instead of the whole animation.
"""
import pathlib

__all__ = ["clips", "crate"]


def _open(path):
    try:
        from pxr import Usd
    except ImportError as absent:
        raise ImportError("USD crates need the package usd-core: pip install usd-core") from absent
    return Usd.Stage.Open(str(path))


def crate(path):
    """Writes NAME.usdc beside NAME.usda. Returns its path.

    path  the .usda file of a run
    """
    target = pathlib.Path(path).with_suffix(".usdc")
    stage = _open(path)  # its layer lives as long as it does
    stage.GetRootLayer().Export(str(target))
    return target


def _sampled(stage):
    return [a for prim in stage.Traverse() for a in prim.GetAttributes() if a.GetNumTimeSamples() > 0]


def _write_clip(source, attributes, time, path):
    """A crate with the values of one time."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateNew(str(path))
    layer.startTimeCode = layer.endTimeCode = time
    for attribute in attributes:
        value = attribute.Get(time)
        if value is None:
            continue
        prim = Sdf.CreatePrimInLayer(layer, attribute.GetPrim().GetPath())
        prim.specifier = Sdf.SpecifierOver
        spec = Sdf.AttributeSpec(prim, attribute.GetName(), attribute.GetTypeName())
        layer.SetTimeSample(spec.path, time, value)
    layer.Save()


def _write_top(stage, attributes, first, last, folder, stem, path):
    """The stage without time samples of its own, whose values are those of the clips."""
    from pxr import Sdf, Usd

    layer = Sdf.Layer.CreateNew(str(path), args={"format": "usdc"})
    layer.TransferContent(stage.GetRootLayer())
    for attribute in attributes:
        layer.GetAttributeAtPath(attribute.GetPath()).ClearInfo("timeSamples")
    manifest = Sdf.Layer.CreateNew(str(folder / f"{stem}.manifest.usdc"))
    for attribute in attributes:
        prim = Sdf.CreatePrimInLayer(manifest, attribute.GetPrim().GetPath())
        Sdf.AttributeSpec(prim, attribute.GetName(), attribute.GetTypeName())
    manifest.Save()
    top = Usd.Stage.Open(layer)
    for root in top.GetPseudoRoot().GetChildren():
        clip = Usd.ClipsAPI(root)
        clip.SetClipPrimPath(str(root.GetPath()))
        clip.SetClipTemplateAssetPath(f"./{folder.name}/{stem}.####.usdc")
        clip.SetClipTemplateStride(1)
        clip.SetClipTemplateStartTime(first)
        clip.SetClipTemplateEndTime(last)
        clip.SetClipManifestAssetPath(f"./{folder.name}/{stem}.manifest.usdc")
    layer.Save()


def clips(path):
    """Writes NAME.usd, whose values are in NAME_clips/NAME.0001.usdc and so on, beside NAME.usda. Returns its path.

    path  the .usda file of a run
    """
    path = pathlib.Path(path)
    stage = _open(path)
    attributes = _sampled(stage)
    first, last = int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode())
    folder = path.parent / f"{path.stem}_clips"
    folder.mkdir(exist_ok=True)
    for old in folder.glob(f"{path.stem}.*.usdc"):
        old.unlink()
    for frame in range(first, last + 1):
        _write_clip(stage, attributes, frame, folder / f"{path.stem}.{frame:04d}.usdc")
    target = path.with_suffix(".usd")
    target.unlink(missing_ok=True)
    _write_top(stage, attributes, first, last, folder, path.stem, target)
    return target
