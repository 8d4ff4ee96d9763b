/// @file supple/scenes/state_bytes.h
/// Saved states in memory, as in files.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "supple/scenes/state.h"

namespace supple::scenes {

/// What `save_state` writes.
[[nodiscard]] std::vector<std::byte> state_bytes(const State& state, const StateOrigin& origin);
/// @param place  where the bytes are from, for messages   @throws as load_state, but not Error{Io}
[[nodiscard]] State state_of_bytes(const std::string& place, std::span<const std::byte> bytes, const StateOrigin& origin, const StateWanted& wanted = {});

}  // namespace supple::scenes
