/// Progress of long work: a bar on a terminal, one line per frame elsewhere.
#pragma once

#include <string>

#include "supple/scenes/run.h"

namespace supple::tool {

enum class ProgressStyle { None, Plain, Bar };

/// auto: a bar when stderr is a terminal, plain lines otherwise.
[[nodiscard]] ProgressStyle progress_style(const std::string& name);

class ProgressBar {
 public:
  explicit ProgressBar(ProgressStyle style) : style_(style) {}
  void show(const scenes::Progress& progress);
  void finish();

 private:
  ProgressStyle style_;
  bool drawn_ = false;
};

}  // namespace supple::tool
