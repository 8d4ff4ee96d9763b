#include "supple/core/content_versions.h"

#include <algorithm>

#include "supple/core/hash.h"

namespace supple {

void ContentVersions::begin_frame() {
  std::erase_if(content_, [](const auto& entry) { return !entry.second.requested; });
  for (auto& [hash, content] : content_) content.requested = false;
}

std::uint64_t ContentVersions::of(std::span<const std::uint64_t> words) {
  const std::uint64_t hash = hash_bytes(std::as_bytes(words));
  const auto [begin, end] = content_.equal_range(hash);
  for (auto at = begin; at != end; ++at) {
    Content& content = at->second;
    if (content.requested || !std::equal(words.begin(), words.end(), content.words.begin(), content.words.end())) continue;
    content.requested = true;
    return content.number;
  }
  content_.emplace(hash, Content{.words = {words.begin(), words.end()}, .number = next_});
  return next_++;
}

}  // namespace supple
