#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <numbers>
#include <sstream>
#include <utility>
#include <vector>

#include "fuzzers.h"
#include "scene_mutations.h"
#include "supple/core/io/mesh_files.h"
#include "supple/scenes/read_scene.h"

namespace supple::stress {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kWithoutVoxel = 10;  // one mesh in so many gets the lattice that its size asks for; the others a coarse one, which is quick
constexpr int kAround = 10, kAcross = 6;  // of the torus

struct Seed {
  std::string extension;
  bool text = true;
  std::string bytes;
};

Mesh torus() {
  Mesh mesh;
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const double u = 2.0 * std::numbers::pi * i / kAround, v = 2.0 * std::numbers::pi * j / kAcross;
      const Vec3 outward(std::cos(u) * std::cos(v), std::sin(u) * std::cos(v), std::sin(v));
      mesh.position.push_back(Vec3(0.3 * std::cos(u), 0.3 * std::sin(u), 0.0) + 0.1 * outward);
      mesh.normal.push_back(outward);
      const auto at = [](int a, int b) { return static_cast<std::uint32_t>((a % kAround) * kAcross + b % kAcross); };
      mesh.triangle.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangle.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

std::string ascii_ply(const Mesh& mesh) {
  std::ostringstream out;
  out << "ply\nformat ascii 1.0\ncomment made here\nelement vertex " << mesh.position.size() << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
      << mesh.triangle.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vec3& x : mesh.position) out << x.x() << ' ' << x.y() << ' ' << x.z() << '\n';
  for (const auto& t : mesh.triangle) out << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  return out.str();
}

std::string off(const Mesh& mesh) {
  std::ostringstream out;
  out << "OFF\n" << mesh.position.size() << ' ' << mesh.triangle.size() << " 0\n";
  for (const Vec3& x : mesh.position) out << x.x() << ' ' << x.y() << ' ' << x.z() << '\n';
  for (const auto& t : mesh.triangle) out << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  return out.str();
}

std::string ascii_stl(const Mesh& mesh) {
  std::ostringstream out;
  out << "solid torus\n";
  for (const auto& t : mesh.triangle) {
    out << "facet normal 0 0 0\nouter loop\n";
    for (const std::uint32_t v : t) out << "vertex " << mesh.position[v].x() << ' ' << mesh.position[v].y() << ' ' << mesh.position[v].z() << '\n';
    out << "endloop\nendfacet\n";
  }
  out << "endsolid torus\n";
  return out.str();
}

template <class T>
void append(std::string& bytes, T value) {
  std::array<char, sizeof value> raw{};
  std::memcpy(raw.data(), &value, sizeof value);
  bytes.append(raw.data(), raw.size());
}

std::string binary_stl(const Mesh& mesh) {
  std::string bytes(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangle.size()));
  for (const auto& t : mesh.triangle) {
    for (int k = 0; k < 3; ++k) append(bytes, 0.0F);
    for (const std::uint32_t v : t) {
      for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(mesh.position[v][k]));
    }
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

std::string heights() {
  std::ostringstream out;
  out << "x,y,z\n";
  for (int j = 0; j < 6; ++j) {
    for (int i = 0; i < 6; ++i) out << 0.2 * i - 0.5 << ',' << 0.2 * j - 0.5 << ',' << -0.3 - 0.01 * ((i * j) % 5) << '\n';
  }
  return out.str();
}

std::string random_word(Random& random) {
  static const std::vector<std::string> words{"0", "-1", "1", "3", "4", "1e9", "1e300", "1e-300", "-1e30", "nan", "inf", "4294967295", "4294967296", "-2147483649",
                                              "99999999999999999999", "0x10", "v", "f", "ply", "element", "property", "list", "vertex", "face", "end_header", "format",
                                              "binary_big_endian", "uchar", "double", "facet", "endsolid", "OFF", "#", "1//1", "1/1/1", "-1", "\\", ""};
  return random.of(words);
}

/// Another number near the one that a word is.
std::string nudged(const std::string& word, Random& random) {
  char* end = nullptr;
  const double number = std::strtod(word.c_str(), &end);
  if (end == word.c_str() || *end != '\0' || word.find('.') == std::string::npos) return word;
  std::ostringstream out;
  out << number + (static_cast<double>(random.below(2001)) - 1000.0) * (random.one_in(2) ? 1e-5 : 1e-3);
  return out.str();
}

/// Words exchanged, dropped, doubled, numbers moved; lines dropped, doubled, exchanged.
std::string change_words(const std::string& text, Random& random) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  const bool gentle = random.one_in(2);  // places alone: the faces stay closed
  for (std::size_t left = 1 + random.below(6); left > 0 && !lines.empty(); --left) {
    std::string& line = lines[random.below(lines.size())];
    std::vector<std::string> words;
    std::istringstream parts(line);
    for (std::string word; parts >> word;) words.push_back(word);
    switch (gentle ? 7 : random.below(7)) {
      case 7:
        for (std::string& word : words) word = nudged(word, random);
        break;
      case 0: std::swap(line, lines[random.below(lines.size())]); continue;
      case 1: lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(random.below(lines.size()))); continue;
      case 2: lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(random.below(lines.size())), std::string(line)); continue;
      case 3: words.push_back(random_word(random)); break;
      case 4:
        if (!words.empty()) words.erase(words.begin() + static_cast<std::ptrdiff_t>(random.below(words.size())));
        break;
      default:
        if (!words.empty()) words[random.below(words.size())] = random_word(random);
    }
    line.clear();
    for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
  }
  std::string out;
  for (const std::string& line : lines) out += line + (random.one_in(200) ? "\r\n" : "\n");
  return out;
}

std::string change_bytes(std::string bytes, Random& random) {
  for (std::size_t left = 1 + random.below(6); left > 0 && !bytes.empty(); --left) {
    // The head decides about all that follows.
    const std::size_t at = random.below(random.one_in(2) ? bytes.size() : std::min<std::size_t>(bytes.size(), 300));
    switch (random.below(6)) {
      case 0: bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << random.below(8))); break;
      case 1: bytes[at] = static_cast<char>(random.below(256)); break;
      case 2: bytes.erase(at, 1 + random.below(16)); break;
      case 3: bytes.insert(at, 1 + random.below(16), static_cast<char>(random.one_in(2) ? 0xff : 0)); break;
      case 4:
        for (std::size_t k = at; k < std::min(at + 4, bytes.size()); ++k) bytes[k] = static_cast<char>(random.one_in(2) ? 0xff : 0x7f);
        break;
      default:
        if (random.one_in(3)) bytes.resize(at);
    }
  }
  return bytes;
}

class FileFuzzer {
 public:
  explicit FileFuzzer(FuzzSettings settings) : settings_(std::move(settings)) {
    const Mesh mesh = torus();
    const fs::path ply = settings_.scratch / "seed.ply", obj = settings_.scratch / "seed.obj";
    io::write_ply(ply, mesh);
    io::write_obj(obj, mesh);
    seeds_ = {{"obj", true, file_text(obj)},
              {"obj", true, file_text(settings_.sources / "scenes/library/contacts/roof.obj")},
              {"ply", true, ascii_ply(mesh)},
              {"ply", false, file_text(ply)},
              {"off", true, off(mesh)},
              {"stl", true, ascii_stl(mesh)},
              {"stl", false, binary_stl(mesh)},
              {"heights.csv", true, heights()},
              {"points.csv", true, file_text(settings_.sources / "scenes/library/objects/hand.csv")}};
  }

  [[nodiscard]] Trial trial(std::uint64_t number) const {
    const Seed input = make(number);
    const std::string file = "fuzz." + input.extension;
    write_text(settings_.scratch / file, input.bytes);
    return judged("fuzz.yaml", [&] { check_scene(scenes::parse_scene(scene_with(file, number % kWithoutVoxel == 0), "fuzz.yaml", settings_.scratch)); });
  }

  [[nodiscard]] fs::path keep(const FoundFault& found) const {
    const Seed input = make(found.number);
    const fs::path path = settings_.scratch / ("file_" + std::to_string(settings_.seed) + '_' + std::to_string(found.number) + '.' + input.extension);
    write_text(path, input.bytes);
    return path;
  }

 private:
  [[nodiscard]] Seed make(std::uint64_t number) const {
    Random random(settings_.seed, number);
    Seed seed = random.of(seeds_);
    seed.bytes = seed.text && !random.one_in(4) ? change_words(seed.bytes, random) : change_bytes(seed.bytes, random);
    return seed;
  }

  static std::string scene_with(const std::string& file, bool own_voxel) {
    const bool points = file.ends_with("points.csv"), table = file.ends_with("heights.csv");
    const std::string places = points ? "{arrange: file, file: " + file + ", mass: 0.1}" : "{at: [0, 0, 0.6], mass: 0.1}";
    std::string scene = "schema: 1\nduration: 0.1\nobjects:\n  - {name: ball, particles: " + places +
                        ", separate: true, skeleton: [{shape: point, kernel: {radius: 0.2}}], contact: {}}\n";
    if (!points) scene += "obstacles:\n  - {name: solid, shape: " + std::string(table ? "heights" : "mesh") + ", file: " + file +
                          (table || own_voxel ? "}\n" : ", voxel: 0.05}\n");
    return scene;
  }

  FuzzSettings settings_;
  std::vector<Seed> seeds_;
};

}  // namespace

Fuzzer file_fuzzer(const FuzzSettings& settings) {
  const auto fuzzer = std::make_shared<FileFuzzer>(settings);
  return {{}, [fuzzer](std::uint64_t number) { return fuzzer->trial(number); }, [fuzzer](const FoundFault& found) { return fuzzer->keep(found); }};
}

}  // namespace supple::stress
