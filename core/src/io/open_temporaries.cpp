#include "supple/core/io/open_temporaries.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>

namespace supple::io {
namespace {

constexpr std::size_t kMostKnown = 64;
constexpr std::size_t kLongestPath = 1024;  // with its end

enum class Use : int { Free, Taken, Known };

struct Slot {
  std::atomic<Use> use{Use::Free};
  std::array<char, kLongestPath> path{};
};

std::array<Slot, kMostKnown> slots;

}  // namespace

OpenTemporary::OpenTemporary(const char* path) noexcept {
  const std::size_t size = std::strlen(path) + 1;
  if (size > kLongestPath) return;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    Use free = Use::Free;
    if (!slots[k].use.compare_exchange_strong(free, Use::Taken)) continue;
    std::memcpy(slots[k].path.data(), path, size);
    slots[k].use.store(Use::Known, std::memory_order_release);
    slot_ = static_cast<int>(k);
    return;
  }
}

OpenTemporary::~OpenTemporary() {
  if (slot_ >= 0) slots[static_cast<std::size_t>(slot_)].use.store(Use::Free, std::memory_order_release);
}

void remove_open_temporaries() noexcept {
  for (const auto remove : {::unlink, ::rmdir}) {
    for (const Slot& slot : slots) {
      if (slot.use.load(std::memory_order_acquire) == Use::Known) static_cast<void>(remove(slot.path.data()));
    }
  }
}

}  // namespace supple::io
