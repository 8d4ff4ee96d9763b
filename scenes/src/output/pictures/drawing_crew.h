/// @file drawing_crew.h
/// Frames drawn at the same time, from saved states.
#pragma once

#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "output/files/frame_writer.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Memory of this process [byte].
[[nodiscard]] double resident_bytes();
/// Number of frames to draw at the same time when each needs `share` bytes, at least a megabyte; one where times are measured exactly, and where there is so little to draw that
/// another OpenGL context takes longer than it saves.
[[nodiscard]] int crew_size(const Scene& scene, const RunOptions& options, std::size_t frames, double share);

/// Each member has its own simulation and renderer, so that no byte depends on the others. The thread that made the
/// crew is a member too: it may simulate first, and joins with its own.
class DrawingCrew {
 public:
  /// Member of the thread that makes the crew, with its profile so far.
  struct Leader {
    Simulation& simulation;
    FrameWriter& writer;
    RunResult& result;
  };

  /// What is to be drawn.
  struct Work {
    const Scene& scene;
    const RunOptions& options;
    const OutputRequest& outputs;
    std::vector<int> frames;  ///< ascending
    int saved = 0;            ///< the last of them whose state is there
  };

  DrawingCrew(Work work, int members, Leader leader, Reporter& report);
  ~DrawingCrew();  ///< waits for frames in hand, leaves the others
  DrawingCrew(const DrawingCrew&) = delete;
  DrawingCrew& operator=(const DrawingCrew&) = delete;

  /// States up to this frame are saved. @return false where the crew has stopped
  [[nodiscard]] bool saved(int frame);
  /// Reports that `frame` is being simulated, unless frames before it are still being drawn.
  void simulating(int frame);
  /// After the last state: helps to draw the remaining frames, and adds up the work of all.
  /// @throws the exception of the first frame that failed
  void join();
  /// The same, but frames that are not in work stay undrawn.
  void leave();

 private:
  struct Member;
  void begin(Member& member);
  void work(Simulation& simulation, FrameWriter& writer);
  /// The next frame to draw; 0: none. Waits for states that are not saved yet.
  [[nodiscard]] int next_frame();
  void done();
  void fail(int frame);
  /// @param leave  whether frames that are not in work stay undrawn
  void dismiss(bool leave);
  void book();
  [[nodiscard]] bool interrupted() const { return options_.interrupt != nullptr && options_.interrupt->load() != 0; }

  struct Member {
    std::thread thread;
    Profile profile{};
    PictureTimes pictures;
    int pictures_drawn = 0;
    std::vector<std::string> warnings;
  };

  const Scene& scene_;
  RunOptions options_;
  OutputRequest outputs_;
  std::vector<int> frames_;
  Leader leader_;
  Reporter& report_;
  Profile profile_before_;
  PictureTimes pictures_before_;
  double cpu_before_;

  std::mutex opening_;  // context libraries are opened one at a time
  std::mutex mutex_;    // guards all members below
  std::condition_variable change_;
  std::vector<Member> members_;
  std::size_t next_ = 0;
  int at_work_ = 0;
  int saved_;
  bool complete_ = false;  // all states are saved
  std::exception_ptr failure_;
  int failed_ = std::numeric_limits<int>::max();
};

}  // namespace supple::scenes
