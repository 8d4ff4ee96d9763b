#include "progress_bar.h"

#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "print.h"

namespace supple::tool {
namespace {

constexpr int kBarWidth = 30;

std::string clock(double seconds) {
  if (seconds < 0.0) return "--:--";
  char text[32];
  const int whole = static_cast<int>(seconds + 0.5);
  std::snprintf(text, sizeof text, "%d:%02d", whole / 60, whole % 60);
  return text;
}

}  // namespace

ProgressStyle progress_style(const std::string& name) {
  if (name == "none") return ProgressStyle::None;
  if (name == "bar") return ProgressStyle::Bar;
  if (name == "auto" && isatty(STDERR_FILENO) != 0) return ProgressStyle::Bar;
  return ProgressStyle::Plain;
}

void ProgressBar::show(const scenes::Progress& progress) {
  if (style_ == ProgressStyle::None) return;
  if (style_ == ProgressStyle::Plain) {
    print(std::cerr, "frame %d/%d stage %s rate %.2f left %s\n", progress.frame, progress.frame_count,
                 progress.stage.c_str(), progress.frames_per_s, clock(progress.left_s).c_str());
    return;
  }
  const int filled = progress.frame_count > 0 ? kBarWidth * progress.frame / progress.frame_count : 0;
  std::string bar(static_cast<std::size_t>(filled), '#');
  bar.resize(kBarWidth, '.');
  print(std::cerr, "\r[%s] frame %d/%d  %-8s  %5.1f frames/s  left %s   ", bar.c_str(), progress.frame,
               progress.frame_count, progress.stage.c_str(), progress.frames_per_s, clock(progress.left_s).c_str());
  drawn_ = true;
}

void ProgressBar::finish() {
  if (drawn_) std::cerr << '\n';
  drawn_ = false;
}

}  // namespace supple::tool
