#include "supple/scenes/gltf.h"

#include <vector>

#include "output/files/animation_parts.h"
#include "output/files/frame_writer.h"
#include "output/files/saved_frames.h"
#include "output/run/unreached.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/gltf_file.h"

namespace supple::scenes {

std::filesystem::path write_gltf(const Scene& given, const RunOptions& options) {
  const InterruptScope scope(options.interrupt);
  const Scene scene = scene_to_draw(given, options.folder, options.frames);
  const std::vector<int> frames = saved_frames(options.folder, scene, options.frames);
  Simulation simulation(scene, {.threads = options.threads, .delaunay = options.delaunay, .interrupt = options.interrupt, .memory = options.scene_memory,
                                .questions = true});
  const std::filesystem::path path = options.folder / (scene_name(scene) + ".glb");
  io::GltfAnimation animation(path, scene.frame_rate, animated_objects(scene));
  Reporter report(options, frames.back());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    report("gltf", frames[i], static_cast<double>(i + 1) / static_cast<double>(frames.size()));
    simulation.restore(load_frame(options.folder, scene, frames[i]));
    const AnimatedFrame frame(simulation);
    animation.add_frame(frames[i], frame.meshes(), frame.cameras());
  }
  animation.finish();
  return path;
}

}  // namespace supple::scenes
