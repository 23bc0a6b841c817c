// The newest raymap of a running rig, with its age.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host_tool/look/film.h"
#include "host_tool/look/server.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "stitch/media/raymap/raymap.h"

namespace nodal::host::look {

/// Pulls raymaps, always the newest, and connects again when the rig goes away. Answers:
///   live?after=N    200 with the JPEG of the newest raymap when its number is above N, else 204. Headers X-Number,
///                   X-Set and X-Age-Ms (of its mid-exposure; X-Age-Of says "mid-exposure", or "arrival" where the
///                   rig's clock is not known here); X-Problem: why there is none newer.
///
/// Threading: a thread of its own talks to the rig; the functions are for any thread.
/// Ownership: the destructor ends the thread.
class LiveRig {
 public:
  using Connect = std::function<Result<std::unique_ptr<RigConnection>>()>;

  /// `same_clock`: the rig is on this machine, so that its times are those of this machine's clock.
  LiveRig(Connect connect, bool same_clock);
  ~LiveRig();
  LiveRig(const LiveRig&) = delete;
  LiveRig& operator=(const LiveRig&) = delete;

  /// Waits for the first raymap. Errors: why there is none after `at_most`; kCancelled after Ctrl-C.
  Result<media::Raymap> first(Duration at_most);
  Answer answer(const Wanted& wanted) const;

 private:
  struct Newest {
    media::Raymap raymap;
    std::shared_ptr<const std::vector<std::uint8_t>> jpeg;
    std::uint64_t number = 0;  ///< 0: none yet
    Duration arrived;
  };

  void run();
  void stop();
  /// Until the connection is lost or stop() is asked for.
  Status pull(RigConnection& rig);
  void keep(media::Raymap raymap, Duration now);
  void say(const std::string& problem);
  bool stops(Duration wait);

  const Connect connect_;
  const bool same_clock_;
  mutable std::mutex mutex_;  ///< protects all below
  std::condition_variable changed_;
  Newest newest_;
  std::string problem_ = "no answer of the rig yet";
  bool stops_ = false;
  std::thread thread_;
};

}  // namespace nodal::host::look
