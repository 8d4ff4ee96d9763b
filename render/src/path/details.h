/// @file details.h
/// Pixels with detail that a filter cannot restore.
#pragma once

#include "path/integrator.h"

namespace supple::render::path {

/// Fills film.detailed, and makes room for their samples: each pixel by itself and its neighbours.
void find_details(const CameraMatrices& camera, const TraceSettings& settings, const Executor& executor, Film& film);

}  // namespace supple::render::path
