#include "supple/scenes/state.h"
#include "supple/scenes/state_bytes.h"

#include <array>
#include <cstring>
#include <optional>
#include <span>

#include "file/fields/scene_keys.h"
#include "output/run/program_identity.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

constexpr std::uint64_t kMagic = 0x31656c7070757373;  // "ssupple1" as little-endian bytes
constexpr std::uint64_t kVersion = 16;
constexpr std::size_t kLargestFile = std::size_t{8} << 30;

void write(StateWriter& out, const Vec3& v) { out.write(std::span<const Vec3>(&v, 1)); }

void read(StateReader& in, Vec3& v) {
  std::vector<Vec3> one;
  in.read(one);
  if (one.size() != 1) throw Error(ErrorKind::Corrupt, Fault{.expected = "expected one vector in the saved state"});
  v = one[0];
}

void save_reach(StateWriter& out, const RunRecord& r) {
  out.write(std::uint64_t{r.solids.size()});
  for (const RunRecord::Solid& solid : r.solids) {
    out.write(std::string_view(solid.name));
    out.write(std::uint64_t{solid.reached});
  }
  out.write(r.reach_frames);
  out.write(std::uint64_t{r.reach.size()});
  for (const std::vector<Box>& boxes : r.reach) {
    std::vector<Vec3> corners;
    for (const Box& box : boxes) corners.insert(corners.end(), {box.lower, box.upper});
    out.write(std::span<const Vec3>(corners));
  }
}

void load_reach(StateReader& in, RunRecord& r) {
  std::uint64_t n = 0;
  in.read(n);
  r.solids.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    RunRecord::Solid solid;
    std::uint64_t reached = 0;
    in.read(solid.name);
    in.read(reached);
    solid.reached = reached != 0;
    r.solids.push_back(std::move(solid));
  }
  in.read(r.reach_frames);
  in.read(n);
  r.reach.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    std::vector<Vec3> corners;
    in.read(corners);
    if (corners.size() % 2 != 0 || r.reach_frames == 0) throw Error(ErrorKind::Corrupt, Fault{.expected = "expected boxes in the saved state"});
    std::vector<Box>& boxes = r.reach.emplace_back();
    for (std::size_t k = 0; k < corners.size(); k += 2) boxes.push_back({corners[k], corners[k + 1]});
  }
}

/// Members of PairContact that are numbers, and those that are vectors.
std::array<double*, 12> numbers_of(RunRecord::PairContact& p) {
  return {&p.contact_time,  &p.peak_force, &p.peak_time,    &p.largest_depth, &p.first_begin, &p.first_end,
          &p.approach_speed, &p.rebound_speed, &p.depth, &p.depth_before, &p.last_step, &p.touch_begin};
}
std::array<Vec3*, 4> vectors_of(RunRecord::PairContact& p) { return {&p.impulse, &p.force, &p.touch_impulse, &p.touch_velocity}; }

void save_contacts(StateWriter& out, std::vector<RunRecord::PairContact> pairs) {
  out.write(std::uint64_t{pairs.size()});
  for (RunRecord::PairContact& pair : pairs) {
    for (const std::uint64_t value : {std::uint64_t{pair.objects.a}, std::uint64_t{pair.objects.b}, pair.touches, std::uint64_t{pair.touching}, std::uint64_t{pair.begun}}) {
      out.write(value);
    }
    for (const double* value : numbers_of(pair)) out.write(*value);
    for (const Vec3* value : vectors_of(pair)) write(out, *value);
  }
}

void load_contacts(StateReader& in, std::vector<RunRecord::PairContact>& pairs) {
  std::uint64_t n = 0;
  in.read(n);
  pairs.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    RunRecord::PairContact pair;
    std::uint64_t a = 0, b = 0, touching = 0, begun = 0;
    for (std::uint64_t* value : {&a, &b, &pair.touches, &touching, &begun}) in.read(*value);
    pair.objects = {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)};
    pair.touching = touching != 0;
    pair.begun = begun != 0;
    for (double* value : numbers_of(pair)) in.read(*value);
    for (Vec3* value : vectors_of(pair)) read(in, *value);
    pairs.push_back(pair);
  }
}

void save_record(StateWriter& out, const RunRecord& r) {
  out.write(std::uint64_t{r.valid});
  write(out, r.initial.momentum);
  write(out, r.initial.angular_momentum);
  out.write(r.initial.kinetic_energy);
  for (const double value : {r.initial_energy, r.largest_energy, r.momentum_scale, r.angular_momentum_scale,
                             r.momentum_error, r.angular_momentum_error, r.energy_error, r.most_dissipated, r.energy_returned,
                             r.contact_residual, r.largest_overlap, r.largest_overlap_share}) {
    out.write(value);
  }
  out.write(std::uint64_t{r.objects.size()});
  for (const auto& o : r.objects) {
    out.write(o.largest_deformation);
    out.write(o.final_shape_error);
  }
  out.write(r.core_impulses);
  out.write(std::uint64_t{r.overloads.size()});
  for (const auto& o : r.overloads) {
    out.write(std::string_view(o.a));
    out.write(std::string_view(o.b));
    for (const double value : {o.time, o.energy, o.capacity}) out.write(value);
  }
  out.write(std::uint64_t{r.pair_work.size()});
  for (const auto& pair : r.pair_work) {
    out.write(std::uint64_t{pair.bodies.a});
    out.write(std::uint64_t{pair.bodies.b});
    out.write(pair.work);
    out.write(pair.power);
  }
  save_contacts(out, r.pair_contacts);
  save_reach(out, r);
}

void load_record(StateReader& in, RunRecord& r) {
  std::uint64_t flag = 0;
  in.read(flag);
  r.valid = flag != 0;
  read(in, r.initial.momentum);
  read(in, r.initial.angular_momentum);
  in.read(r.initial.kinetic_energy);
  for (double* value : {&r.initial_energy, &r.largest_energy, &r.momentum_scale, &r.angular_momentum_scale,
                        &r.momentum_error, &r.angular_momentum_error, &r.energy_error, &r.most_dissipated, &r.energy_returned,
                        &r.contact_residual, &r.largest_overlap, &r.largest_overlap_share}) {
    in.read(*value);
  }
  std::uint64_t n = 0;
  in.read(n);
  r.objects.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    RunRecord::ObjectRecord o;
    in.read(o.largest_deformation);
    in.read(o.final_shape_error);
    r.objects.push_back(o);
  }
  in.read(r.core_impulses);
  in.read(n);
  r.overloads.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    RunRecord::Overload o;
    in.read(o.a);
    in.read(o.b);
    for (double* value : {&o.time, &o.energy, &o.capacity}) in.read(*value);
    r.overloads.push_back(std::move(o));
  }
  in.read(n);
  r.pair_work.clear();
  for (std::uint64_t i = 0; i < n; ++i) {
    std::uint64_t a = 0, b = 0;
    RunRecord::PairWork pair;
    in.read(a);
    in.read(b);
    in.read(pair.work);
    in.read(pair.power);
    pair.bodies = {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)};
    r.pair_work.push_back(pair);
  }
  load_contacts(in, r.pair_contacts);
  load_reach(in, r);
}

Fault fault_of(const std::filesystem::path& path, std::string expected, std::string found, std::string hint) {
  return {.place = path.string(), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)};
}

[[noreturn]] void damaged(const std::filesystem::path& path, std::string found) {
  throw DamagedState(ErrorKind::Corrupt, fault_of(path, "expected a complete saved state", std::move(found),
                                                  "`supple run --resume` continues from the last good one before it"));
}

/// By its first bytes, so that a large file of another kind is not read.
void expect_magic(const std::filesystem::path& path) {
  std::uint64_t magic = 0;
  const std::optional<std::size_t> size = io::read_start(path, std::as_writable_bytes(std::span(&magic, 1)));
  if (size == sizeof magic && magic != kMagic) damaged(path, "another kind of file");
}

[[noreturn]] void refuse(const std::filesystem::path& path, std::string expected, std::string found, std::string hint) {
  throw Error(ErrorKind::Corrupt, fault_of(path, std::move(expected), std::move(found), std::move(hint)));
}

/// "do this, or that"
std::string either(const std::string& one, const std::string& other) { return one.empty() || other.empty() ? one + other : one + ", " + other; }

[[noreturn]] void refuse_scene(const std::filesystem::path& path, const StateOrigin& origin, const std::string& keys, const std::string& otherwise) {
  const KeyDifferences differ = origin.keys && !keys.empty() ? differences(keys_in(*origin.keys), keys_in(keys)) : KeyDifferences{};
  refuse(path, "expected a state of this scene", differ.found.empty() ? "one of another scene" : "one of a scene with " + differ.found,
         either(differ.set.empty() ? "use the scene file and the --set that wrote it" : "its scene is this one with " + differ.set, otherwise));
}

void check_wanted(const std::filesystem::path& path, const State& state, const std::string& program, const StateWanted& wanted) {
  if (wanted.frame && (state.frame != *wanted.frame || state.substep != 0)) {
    const std::string frame = std::to_string(state.frame);
    refuse(path, "expected the state of frame " + std::to_string(*wanted.frame),
           state.substep == 0 ? "that of frame " + frame : "one between frames " + frame + " and " + std::to_string(state.frame + 1),
           "give the file its own name, or remove it: `supple run --resume` computes it again");
  }
  if (wanted.same_program && program != program_identity()) {
    refuse(path, "expected a state of this build of supple", "one of another build, whose results may differ in the last bit",
           "continue with that build, or use --overwrite to run the scene again");
  }
}

}  // namespace

std::uint64_t State::hash() const {
  Hasher hasher;
  hasher.add(static_cast<std::uint64_t>(frame));
  hasher.add(static_cast<std::uint64_t>(substep));
  hasher.add(static_cast<std::uint64_t>(halvings));
  hasher.add(steps);
  particles.hash(hasher);
  kick.hash(hasher);
  ledger.hash(hasher);
  links.hash(hasher);
  hasher.add(std::span<const double>(broken_for));
  for (const auto& v : volumes) v.hash(hasher);
  for (const auto& pair : apart) {
    hasher.add(std::uint64_t{pair.a});
    hasher.add(std::uint64_t{pair.b});
  }
  for (const auto& s : samples) s.hash(hasher);
  sleep.hash(hasher);
  sticks.hash(hasher);
  return hasher.value();
}

StateOrigin origin_of(const Scene& scene) { return {scene.content_hash, scene.motion_keys}; }

std::vector<std::byte> state_bytes(const State& state, const StateOrigin& origin) {
  StateWriter out;
  out.write(kMagic);
  out.write(kVersion);
  out.write(origin.scene);
  out.write(origin.keys ? std::string_view(*origin.keys) : std::string_view());
  out.write(std::string_view(program_identity()));
  for (const std::int32_t value : {state.frame, state.substep, state.halvings}) {
    out.write(static_cast<std::uint64_t>(static_cast<std::uint32_t>(value)));
  }
  out.write(state.steps);
  state.particles.save(out);
  state.kick.save(out);
  state.ledger.save(out);
  state.links.save(out);
  out.write(std::span<const double>(state.broken_for));
  out.write(std::uint64_t{state.volumes.size()});
  for (const auto& v : state.volumes) v.save(out);
  out.write(std::uint64_t{state.apart.size()});
  for (const auto& pair : state.apart) {
    out.write(std::uint64_t{pair.a});
    out.write(std::uint64_t{pair.b});
  }
  out.write(std::uint64_t{state.samples.size()});
  for (const auto& s : state.samples) s.save(out);
  state.sleep.save(out);
  state.sticks.save(out);
  save_record(out, state.record);
  const std::uint64_t check = hash_bytes(out.bytes());
  out.write(check);
  return {out.bytes().begin(), out.bytes().end()};
}

void save_state(const std::filesystem::path& path, const State& state, const StateOrigin& origin) {
  io::write_atomically(path, std::span<const std::byte>(state_bytes(state, origin)));
}

State load_state(const std::filesystem::path& path, const StateOrigin& origin, const StateWanted& wanted) {
  expect_magic(path);
  return state_of_bytes(path.string(), io::read_file(path, kLargestFile), origin, wanted);
}

State state_of_bytes(const std::string& place, std::span<const std::byte> bytes, const StateOrigin& origin, const StateWanted& wanted) {
  const std::filesystem::path path(place);
  if (bytes.size() < 4 * sizeof(std::uint64_t)) damaged(path, "a file of " + std::to_string(bytes.size()) + " bytes");
  const std::span<const std::byte> content(bytes.data(), bytes.size() - sizeof(std::uint64_t));
  std::uint64_t check = 0;
  std::memcpy(&check, bytes.data() + content.size(), sizeof check);
  if (check != hash_bytes(content)) damaged(path, "content that does not match its checksum");

  StateReader in(content);
  std::uint64_t magic = 0, version = 0, scene = 0;
  std::string keys, program;
  in.read(magic);
  if (magic != kMagic) damaged(path, "another kind of file");
  in.read(version);
  if (version != kVersion) {
    refuse(path, "expected a saved state of version " + std::to_string(kVersion),
           "version " + std::to_string(version) + ", of another version of supple", either("run the scene again", wanted.otherwise));
  }
  in.read(scene);
  in.read(keys);
  in.read(program);
  if (wanted.belongs_to != nullptr) {
    *wanted.belongs_to = {scene, std::make_shared<const std::string>(keys)};
  } else if (wanted.differences != nullptr) {
    *wanted.differences = origin.keys && !keys.empty() ? differences(keys_in(*origin.keys), keys_in(keys)).found : std::string();
  } else if (scene != origin.scene) {
    refuse_scene(path, origin, keys, wanted.otherwise);
  }
  State state;
  for (std::int32_t* value : {&state.frame, &state.substep, &state.halvings}) {
    std::uint64_t raw = 0;
    in.read(raw);
    *value = static_cast<std::int32_t>(static_cast<std::uint32_t>(raw));
  }
  in.read(state.steps);
  state.particles.load(in);
  state.kick.load(in);
  state.ledger.load(in);
  state.links.load(in);
  in.read(state.broken_for);
  std::uint64_t n = 0;
  in.read(n);
  for (std::uint64_t i = 0; i < n; ++i) state.volumes.emplace_back().load(in);
  in.read(n);
  for (std::uint64_t i = 0; i < n; ++i) {
    std::uint64_t a = 0, b = 0;
    in.read(a);
    in.read(b);
    state.apart.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)});
  }
  in.read(n);
  for (std::uint64_t i = 0; i < n; ++i) {
    implicit::SampleState samples;
    samples.load(in);
    state.samples.push_back(std::move(samples));
  }
  state.sleep.load(in);
  state.sticks.load(in);
  load_record(in, state.record);
  if (!in.at_end()) refuse(path, "expected a saved state", "one with bytes after its end", {});
  check_wanted(path, state, program, wanted);
  return state;
}

}  // namespace supple::scenes
