/// Stage 10: draws the pictures of a scene.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "output/pictures/camera.h"
#include "simulation/frame.h"
#include "supple/render/layers.h"
#include "supple/render/overlay.h"
#include "supple/render/renderer.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Mesh of each obstacle at a time, with its velocity where it moves; empty where it is not visible.
[[nodiscard]] std::vector<Mesh> obstacle_meshes(const Scene& scene, const Model& model, double time);

/// Whether a surface in a box may be visible in a picture of that time; empty where all may be (light between surfaces needs everything).
[[nodiscard]] std::function<bool(const Box&)> shown_by_cameras(const Scene& scene, const Model& model, double time);

class ScenePictures {
 public:
  /// @throws Error{Io} when a texture cannot be read or no context can be made
  ScenePictures(const Scene& scene, const Model& model, render::ContextKind context, int threads);

  /// For pictures only: omits meshes that no camera sees (OpenGL; light between surfaces needs everything), and
  /// chooses their cells by `render.pixel_error`. Call before the first `draw` of a state.
  void limit_meshes(Simulation& simulation) const;

  /// Warnings about objects that contained a camera, as sentences; each once.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

  /// Draws the current state from the camera of this number, and its linear light unless `linear` is null.
  [[nodiscard]] render::Image draw(Simulation& simulation, std::size_t camera, render::LinearImage* linear);
  /// Depth, normals, velocities and object numbers of the picture drawn last, and the names of its items.
  [[nodiscard]] render::Layers layers();
  [[nodiscard]] const std::vector<std::string>& item_names() const { return item_names_; }
  [[nodiscard]] render::RenderTimes times() const { return renderer_->times(); }

 private:
  void warn_inside(Simulation& simulation, std::size_t camera);
  void add_objects(Simulation& simulation);
  [[nodiscard]] const Mesh& shown_mesh(const std::vector<Mesh>& meshes, std::size_t object);
  void add_fields(Simulation& simulation);
  void add_glyphs(const Simulation& simulation);
  void add(render::Item item, std::string name);

  const Scene& scene_;
  render::View view_;
  std::vector<render::Paint> paints_;           ///< of each object
  std::vector<render::Paint> obstacle_paints_;
  std::vector<Mesh> obstacles_;
  std::vector<render::ScaleBar> bars_;
  std::unique_ptr<render::Renderer> renderer_;
  render::RenderSettings settings_;
  std::unique_ptr<render::LayerRenderer> layer_renderer_;  ///< made when layers are first requested
  std::vector<render::Item> items_;
  std::vector<std::string> item_names_;
  double cell_ = 0.0;        ///< of the scene
  std::vector<std::string> warnings_;
  std::deque<Mesh> glyphs_;  ///< of this picture
  std::deque<Mesh> even_meshes_;  ///< of this picture, of objects with look.smooth
};

}  // namespace supple::scenes
