#include "supple/core/interrupt.h"

namespace supple {
namespace {

thread_local const std::atomic<int>* of_scope = nullptr;

}  // namespace

InterruptScope::InterruptScope(const std::atomic<int>* interrupt) noexcept : outer_(of_scope) { of_scope = interrupt; }
InterruptScope::~InterruptScope() { of_scope = outer_; }

const std::atomic<int>* interrupt_of_scope() noexcept { return of_scope; }

}  // namespace supple
