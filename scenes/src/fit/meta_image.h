/// @file meta_image.h
/// Volumes of MetaImage files (ITK's own format): .mha, and .mhd with the voxels in a file beside it.
#pragma once

#include "fit/volume.h"

namespace supple::fit {

/// Voxels as they are or compressed by zlib, in either order of bytes; lengths count as millimetres. @throws as `fit`
[[nodiscard]] Volume read_meta_image(const std::filesystem::path& file);

}  // namespace supple::fit
