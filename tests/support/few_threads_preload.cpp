// A library to load before a program's own: the system lets as many threads live at a time as the variable SUPPLE_THREADS_LEFT says, beside the first.
#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace {

std::atomic<int> living{0};

struct Start {
  void* (*body)(void*);
  void* argument;
};

struct Living {
  ~Living() { --living; }
};

void* live(void* data) {
  const Living until_the_end;
  const Start start = *static_cast<Start*>(data);
  delete static_cast<Start*>(data);
  return start.body(start.argument);
}

}  // namespace

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*), void* argument) {
  const char* const most = std::getenv("SUPPLE_THREADS_LEFT");
  if (most != nullptr && ++living > std::atoi(most)) {
    --living;
    return EAGAIN;
  }
  auto* const start = new Start{body, argument};
  return reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"))(thread, attributes, live, start);
}
