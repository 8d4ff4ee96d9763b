/// @file march_mesher.h
/// A mesh of marching cubes and its data kept from call to call.
#pragma once

#include <memory>

#include "mesh/cubes/march_sampling.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit::march {

struct Marcher {
  SamplerMemory memory;
  BlockTable table;
  MeshScratch scratch;
  Mesh mesh;
  std::unique_ptr<Sampler> sampler;  ///< of the last mesh
  Lattice lattice;                   ///< of the last mesh
  double iso = 0.0;
  bool kept = false;     ///< table and mesh are those of the memory
  bool skipped = false;  ///< option of the last mesh

  /// Makes `mesh`, unrefined.
  void march(const FieldView& field, const Lattice& lattice, bool skip, const Executor& executor, MarchCounts& counts);
  /// Whether no data of the last but one were kept.
  [[nodiscard]] bool whole() const { return sampler->single_precision() ? memory.grid.change().all : memory.view.all; }
  /// Largest counts of a new mesher. @param counts  of this one
  [[nodiscard]] MarchCounts most_counts(const MarchCounts& counts) const;
};

}  // namespace supple::implicit::march
