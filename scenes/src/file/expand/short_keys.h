/// @file short_keys.h
/// The keys that write out a scene (expand_scene.h) and are gone before its fields are read.
#pragma once

#include "file/yaml/yaml_tree.h"

namespace supple::scenes {

/// Adds a fault for every unknown key that is nearest to `include`, `variables`, `defaults` or `materials`, in items of lists to `repeat` or
/// `include`, and in objects to `emit`: what such a key would have brought is missing elsewhere, where it is not worth a fault of its own.
/// @param root  a mapping, with included files
void tell_misspelt_short_keys(const Node& root, FaultList& faults);

}  // namespace supple::scenes
