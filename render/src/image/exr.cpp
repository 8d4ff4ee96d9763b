#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfFloatAttribute.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfStandardAttributes.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <utility>

#include "picture/lighting.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/render/layers.h"

namespace supple::render {
namespace {

/// A file in memory, so that it gets its name when it is complete.
class Memory final : public Imf::OStream {
 public:
  Memory() : Imf::OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto n = static_cast<std::size_t>(count);
    if (at_ + n > bytes_.size()) bytes_.resize(at_ + n);
    std::memcpy(bytes_.data() + at_, bytes, n);
    at_ += n;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t at) override { at_ = at; }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

std::vector<half> halves(const std::vector<float>& values) {
  std::vector<half> out;
  out.reserve(values.size());
  // Light larger than a half float is clamped to its maximum.
  for (const float v : values) out.emplace_back(std::isfinite(v) ? std::clamp(v, -static_cast<float>(HALF_MAX), static_cast<float>(HALF_MAX)) : v);
  return out;
}

constexpr std::array kVelocity = {"velocity.X", "velocity.Y", "velocity.Z"};
constexpr const char* kFingerprint = "fingerprint";

}  // namespace

void write_exr(const std::filesystem::path& path, const LinearImage& picture, const Layers& layers,
               std::span<const std::string> objects, std::string_view fingerprint) {
  const std::size_t count = static_cast<std::size_t>(layers.width) * static_cast<std::size_t>(layers.height);
  SUPPLE_EXPECTS(picture.width == layers.width && picture.height == layers.height && count > 0);
  SUPPLE_EXPECTS(picture.rgba.size() == 4 * count && layers.depth.size() == count && layers.normal.size() == 3 * count);
  SUPPLE_EXPECTS(layers.velocity.size() == 3 * count && layers.object.size() == count);

  const std::vector<half> colour = halves(picture.rgba), normal = halves(layers.normal);

  Imf::Header header(layers.width, layers.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.insert("software", Imf::StringAttribute("supple"));
  std::string names;
  for (std::size_t i = 0; i < objects.size(); ++i) names += (i > 0 ? ", " : "") + std::to_string(i + 1) + ' ' + objects[i];
  header.insert("objects", Imf::StringAttribute(names));
  header.insert("exposure", Imf::FloatAttribute(kExposure));
  if (!fingerprint.empty()) header.insert(kFingerprint, Imf::StringAttribute(std::string(fingerprint)));

  Imf::FrameBuffer buffer;
  const auto add = [&](const char* name, Imf::PixelType type, const void* first, std::size_t stride) {
    header.channels().insert(name, Imf::Channel(type));
    // The library writes from here only.
    char* base = const_cast<char*>(static_cast<const char*>(first));
    buffer.insert(name, Imf::Slice(type, base, stride, stride * static_cast<std::size_t>(layers.width)));
  };
  const auto add_vector = [&](std::initializer_list<const char*> channels, const std::vector<half>& values) {
    const half* value = values.data();
    for (const char* channel : channels) add(channel, Imf::HALF, value++, channels.size() * sizeof(half));
  };
  add_vector({"R", "G", "B", "A"}, colour);
  add_vector({"N.X", "N.Y", "N.Z"}, normal);
  // Halves end at 6e-8 and 65504 m/s.
  for (std::size_t k = 0; k < kVelocity.size(); ++k) add(kVelocity[k], Imf::FLOAT, &layers.velocity[k], 3 * sizeof(float));
  add("Z", Imf::FLOAT, layers.depth.data(), sizeof(float));
  add("id", Imf::UINT, layers.object.data(), sizeof(std::uint32_t));

  Memory memory;
  {
    Imf::OutputFile file(memory, header, 0);  // no threads: the bytes are the same anyway
    file.setFrameBuffer(buffer);
    file.writePixels(layers.height);
  }
  io::write_atomically(path, memory.bytes());
}

std::string exr_fingerprint(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return {};
  try {
    const Imf::InputFile file(path.c_str(), 0);
    const auto* text = file.header().findTypedAttribute<Imf::StringAttribute>(kFingerprint);
    return text == nullptr ? std::string() : text->value();
  } catch (const std::exception&) {
    return {};  // not an OpenEXR file
  }
}

}  // namespace supple::render
