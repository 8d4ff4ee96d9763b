/// @file path_renderer.h
/// The renderer by path tracing; part of builds that found Embree 3.
#pragma once

#include "supple/render/renderer.h"

namespace supple::render {

/// @throws Error{Usage} naming the component in a build without it.
[[nodiscard]] std::unique_ptr<Renderer> make_path_renderer(const RenderSettings& settings);

}  // namespace supple::render
