#include "output/files/frame_writer.h"

#include <algorithm>
#include <utility>

#include "file/fields/scene_keys.h"
#include "file/scene_places.h"
#include "output/files/animation_parts.h"
#include "output/files/frame_tables.h"
#include "output/files/output_files.h"
#include "output/meshes/search_files.h"
#include "output/pictures/frame_looks.h"
#include "output/run/program_identity.h"
#include "output/run/run_origin.h"
#include "supple/core/cpu_time.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

template <class Format>
bool has(const std::vector<Format>& formats, Format format) {
  return std::find(formats.begin(), formats.end(), format) != formats.end();
}

render::ContextKind context_kind(const std::string& name) {
  if (name == "auto") return render::ContextKind::Auto;
  if (name == "osmesa") return render::ContextKind::OSMesa;
  if (name == "egl") return render::ContextKind::Egl;
  throw Error(ErrorKind::Usage, Fault{.place = "--context",
                                      .key = {},
                                      .expected = "expected auto, osmesa or egl",
                                      .found = name,
                                      .hint = {}});
}

/// Extension of the file of a frame in this format; none where all frames share one file.
std::string extension_of(TableName format) { return format == TableName::Csv ? ".csv" : ".vtp"; }
std::string extension_of(MeshName format) {
  switch (format) {
    case MeshName::Ply: return ".ply";
    case MeshName::Obj: return ".obj";
    case MeshName::Usd: break;
  }
  return {};
}

void write_points(const fs::path& folder, const std::string& name, int frame, const std::vector<TableName>& formats,
                  const io::PointSet& points) {
  for (const TableName format : formats) {
    const fs::path path = folder / numbered(name, frame, extension_of(format));
    format == TableName::Csv ? io::write_points_csv(path, points) : io::write_vtp(path, points);
  }
}

}  // namespace

Reporter::Reporter(const RunOptions& options, int frame_count) : options_(options), frame_count_(frame_count) {}

void Reporter::operator()(const std::string& stage, int frame, double done) {
  if (!options_.progress) return;
  const double elapsed = std::chrono::duration<double>(Clock::now() - begin_).count();
  if (!first_) first_ = done;
  const double since = done - *first_;
  const double left = since > 0.02 ? elapsed * (1.0 - done) / since : -1.0;
  options_.progress({stage, frame, frame_count_, elapsed, left, since > 0.0 ? since * frame_count_ / elapsed : 0.0});
}

std::vector<std::string> image_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const CameraDesc& camera : cameras_of(scene)) {
    names.push_back(camera.name.empty() ? scene_name(scene) : scene_name(scene) + '.' + camera.name);
  }
  return names;
}

FrameWriter::FrameWriter(const Scene& scene, const Model& model, const RunOptions& options, OutputRequest outputs)
    : scene_(scene), options_(options), outputs_(outputs), name_(scene_name(scene)), image_names_(image_names(scene)) {
  for (const auto& [wanted, part] : {std::pair{outputs.images, "frames"}, {outputs.meshes, "meshes"}, {outputs.grids, "grids"},
                                     {outputs.contacts, "contacts"}, {outputs.particles, "particles"}, {outputs.samples, "samples"}}) {
    if (wanted) io::make_writable_folder(options.folder / part);
  }
  if (outputs_.images) {
    image_formats_ = scene.output.images ? scene.output.images->formats : ImagesDesc{}.formats;
    look_ = look();
    pictures_ = std::make_unique<ScenePictures>(scene, model, context_kind(options.context), options.threads);
  }
  if (outputs_.samples) samples_ = std::make_unique<SceneSamples>(scene.output.sampling, model.cell);
  if (!outputs_.meshes || !has(scene.output.mesh, MeshName::Usd)) return;
  animation_ = std::make_unique<io::UsdAnimation>(options.folder / (name_ + ".usda"), scene.frame_rate, animated_objects(scene));
}

void FrameWriter::write(Simulation& simulation, Reporter& report, double done) {
  write(simulation, report, done, outputs_.images, true);
}

void FrameWriter::renew(Simulation& simulation, Reporter& report, double done) {
  const bool draws = outputs_.images && !pictures_are_current(simulation.frame(), simulation.state_hash());
  write(simulation, report, done, draws, !files_are_there(simulation.frame()));
}

void FrameWriter::write(Simulation& simulation, Reporter& report, double done, bool draws, bool files) {
  const int frame = simulation.frame();
  if (samples_) follow(simulation, report, done);
  if (!wanted(frame)) return;
  const std::vector<Mesh>* meshes = nullptr;
  if (draws && !outputs_.meshes && options_.skip) pictures_->limit_meshes(simulation);
  if (draws || animation_ || (files && outputs_.meshes)) {
    report("surface", frame, done);
    meshes = &simulation.meshes();
  }
  if (draws) draw(simulation, report, done);
  const StageClock clock(simulation.profile(Stage::Export));
  const bool grids = files && outputs_.grids;
  if (meshes != nullptr) {
    write_searches(options_.folder, name_, frame, simulation.searches());
  } else if (grids) {
    (void)simulation.division();  // finds bulges that hold too little volume
    write_short_bulges(options_.folder, name_, frame, simulation.searches());
  }
  if (animation_) {
    const AnimatedFrame shown(simulation);
    animation_->add_frame(frame, shown.meshes(), shown.cameras());
  }
  if (!files) return;
  if (outputs_.meshes) write_meshes(simulation, *meshes);
  if (grids) grids_.write(options_.folder, name_, frame, simulation);
  write_tables(simulation);
}

std::string FrameWriter::look() const {
  Hasher hasher;
  hasher.add(std::string_view(program_identity()));
  hasher.add(scene_.picture_hash);
  hasher.add(std::string_view(options_.context));
  return to_hex(hasher.value());
}

fs::path FrameWriter::picture_path(std::size_t camera, int frame, ImageName format) const {
  return frame_path(options_.folder, image_names_[camera], frame).replace_extension(format == ImageName::Png ? ".png" : ".exr");
}

bool FrameWriter::pictures_are_current(int frame, std::uint64_t state_hash) const {
  const std::string wanted = picture_fingerprint(look_, state_hash);
  for (std::size_t camera = 0; camera < image_names_.size(); ++camera) {
    for (const ImageName format : image_formats_) {
      const fs::path path = picture_path(camera, frame, format);
      if (wanted != (format == ImageName::Png ? render::png_fingerprint(path) : render::exr_fingerprint(path))) return false;
    }
  }
  return true;
}

PictureLook FrameWriter::look_of(const Scene& scene, const RunOptions& options) {
  const FileAccess files = files_of(scene);
  FileHashes hashes(files);
  return {.program = program_identity(), .context = options.context, .keys = text_of(picture_keys(scene, hashes))};
}

bool FrameWriter::pictures_are_there(int last, int from) const {
  return std::all_of(image_names_.begin(), image_names_.end(),
                     [&](const std::string& name) { return all_have_look(options_.folder, name, look_, last, from); });
}

bool FrameWriter::writes_frames() const {
  return outputs_.images || outputs_.meshes || outputs_.grids || outputs_.contacts || outputs_.particles || outputs_.samples;
}

bool FrameWriter::files_are_there(int frame) const {
  const auto there = [&](const char* part, const std::string& stem, const auto& formats) {
    return std::all_of(formats.begin(), formats.end(), [&](const auto format) {
      const std::string extension = extension_of(format);
      return extension.empty() || fs::exists(options_.folder / part / numbered(stem, frame, extension));
    });
  };
  const OutputDesc& output = scene_.output;
  if (outputs_.contacts && !(there("contacts", name_, output.contacts) && there("contacts", name_ + ".pairs", output.contacts))) return false;
  if (outputs_.particles && !there("particles", name_, output.particles)) return false;
  if (outputs_.grids && !fs::exists(options_.folder / "grids" / numbered(name_, frame, ".vdb"))) return false;
  // An object without a surface has no mesh.
  return !outputs_.meshes || std::any_of(scene_.objects.begin(), scene_.objects.end(),
                                         [&](const ObjectDesc& object) { return there("meshes", name_ + "." + object.name, output.mesh); });
}

bool FrameWriter::renews(int frame, std::uint64_t state_hash) const {
  return samples_ || (wanted(frame) && (animation_ || !files_are_there(frame) ||
                                        (outputs_.images && !pictures_are_current(frame, state_hash))));
}

void FrameWriter::follow(Simulation& simulation, Reporter& report, double done) {
  report("samples", simulation.frame(), done);
  const StageClock clock(simulation.profile(Stage::Export));
  samples_->follow(simulation, Executor(options_.threads));
}

void FrameWriter::draw(Simulation& simulation, Reporter& report, double done) {
  const int frame = simulation.frame();
  const std::string mark = picture_fingerprint(look_, simulation.state_hash());
  report("render", frame, done);
  if (pictures_drawn_ == 0) {  // of a crew the leader draws first
    for (const std::string& name : image_names_) {
      if (remove_stale_film(options_.folder, name, look_, 0)) removed_films_.insert(name);
      remove_stale_sheet(options_.folder, name, look_);
    }
  }
  for (std::size_t camera = 0; camera < image_names_.size(); ++camera) {
    render::Image image;
    render::LinearImage linear;
    render::Layers layers;
    const bool exr = has(image_formats_, ImageName::Exr);
    {
      const StageClock clock(simulation.profile(Stage::Render));
      image = pictures_->draw(simulation, camera, exr ? &linear : nullptr);
      if (exr) layers = pictures_->layers();
    }
    const StageClock clock(simulation.profile(Stage::Export));
    const double begin = process_cpu_seconds();
    if (has(image_formats_, ImageName::Png)) render::write_png(picture_path(camera, frame, ImageName::Png), image, mark);
    if (exr) render::write_exr(picture_path(camera, frame, ImageName::Exr), linear, layers, pictures_->item_names(), mark);
    encode_s_ += process_cpu_seconds() - begin;
    ++images_;
  }
  ++pictures_drawn_;
}

PictureTimes FrameWriter::picture_times() const {
  return {.images = images_, .render = pictures_ ? pictures_->times() : render::RenderTimes{}, .encode_s = encode_s_};
}

void FrameWriter::add_warnings(std::vector<std::string>& warnings) const {
  warnings.insert(warnings.end(), warnings_.begin(), warnings_.end());
  if (pictures_) warnings.insert(warnings.end(), pictures_->warnings().begin(), pictures_->warnings().end());
}

void FrameWriter::write_meshes(const Simulation& simulation, const std::vector<Mesh>& meshes) {
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].position.empty()) continue;
    const std::string stem = name_ + "." + simulation.model().objects[i].name;
    const auto path = [&](const char* extension) {
      return options_.folder / "meshes" / numbered(stem, simulation.frame(), extension);
    };
    if (has(scene_.output.mesh, MeshName::Ply)) io::write_ply(path(".ply"), meshes[i]);
    if (has(scene_.output.mesh, MeshName::Obj)) io::write_obj(path(".obj"), meshes[i]);
  }
}

void FrameWriter::write_tables(Simulation& simulation) {
  const int frame = simulation.frame();
  const OutputDesc& output = scene_.output;
  if (outputs_.contacts) {
    write_points(options_.folder / "contacts", name_, frame, output.contacts, contact_points(simulation));
    write_points(options_.folder / "contacts", name_ + ".pairs", frame, output.contacts, contact_pairs(simulation));
  }
  if (outputs_.particles) {
    write_points(options_.folder / "particles", name_, frame, output.particles, particle_points(simulation));
  }
  if (outputs_.samples) write_points(options_.folder / "samples", name_, frame, output.samples, samples_->points());
}

void FrameWriter::write_time_list(const std::string& part, int last, const std::string& what) {
  std::vector<io::TimedFile> files;
  for (int frame = 1; frame <= last; ++frame) {
    const fs::path file = fs::path(part) / numbered(what.empty() ? name_ : name_ + '.' + what, frame, ".vtp");
    if (fs::exists(options_.folder / file)) files.push_back({(frame - 1) / scene_.frame_rate, file});
  }
  io::write_pvd(options_.folder / (name_ + '_' + (what.empty() ? part : what) + ".pvd"), files);
}

fs::path FrameWriter::finish(Simulation& simulation, Reporter& report, int last) {
  const StageClock clock(simulation.profile(Stage::Export));
  if (animation_) {
    report("usd", last, 0.99);
    animation_->finish();
  }
  if (outputs_.particles && has(scene_.output.particles, TableName::Vtk)) write_time_list("particles", last);
  if (outputs_.contacts && has(scene_.output.contacts, TableName::Vtk)) {
    write_time_list("contacts", last);
    write_time_list("contacts", last, "pairs");
  }
  if (outputs_.samples && has(scene_.output.samples, TableName::Vtk)) write_time_list("samples", last);
  if (!outputs_.images) return {};
  report("film", last, 0.99);
  fs::path first_film;
  for (const std::string& name : image_names_) {
    const fs::path film = make_film(name, last);
    if (first_film.empty()) first_film = film;
  }
  return first_film;
}

/// The contact sheet, and the film if all frames are there in one look. An earlier film that shows others does not stay.
fs::path FrameWriter::make_film(const std::string& name, int last) {
  const FrameLooks looks = look_at_frames(options_.folder, name, last);
  if (options_.contact_sheet) write_contact_sheet(options_.folder, name, looks);
  const std::string why_not = describe_looks(looks, name);
  if (outputs_.film && why_not.empty()) {
    const fs::path film = options_.folder / (name + ".mp4");
    const double frame_rate = scene_.output.film.value_or(FilmDesc{}).frame_rate.value_or(scene_.frame_rate);
    render::encode_film({options_.folder / "frames", name, first_frame_of(options_.folder), last, frame_rate, film_note_of(looks.look, last)}, film, options_.interrupt);
    return film;
  }
  const std::string look = looks.others.empty() ? looks.look : std::string();  // of two looks no film is current
  if (remove_stale_film(options_.folder, name, look, last)) removed_films_.insert(name);
  const bool removed = removed_films_.contains(name);
  if (outputs_.film) {
    warnings_.push_back("no film: " + why_not + (removed ? "; an earlier " + name + ".mp4 of other pictures is removed" : ""));
  } else if (removed) {
    warnings_.push_back(name + ".mp4 is removed: it shows other pictures than frames/ holds");
  } else if (!looks.others.empty()) {
    warnings_.push_back(why_not + " and " + (looks.others.size() == 1 ? "is" : "are") + " left out of " + name + "_sheet.png");
  }
  return {};
}

}  // namespace supple::scenes
