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

/// Pulls raymaps, always the newest, while somebody asks for them, and connects again when the rig goes away. Answers:
///   live?after=N    200 with the JPEG of the newest raymap as soon as its number is above N, 204 if none is within
///                   kWait. Headers X-Number, X-Set and X-Age-Ms (of its mid-exposure; X-Age-Of says "mid-exposure",
///                   or "arrival" where the rig's clock is not known here); X-Clock-Ms: this computer's clock at the
///                   answer; X-Problem: why there is none newer.
///
/// Threading: a thread of its own talks to the rig; the functions are for any thread.
/// Ownership: the destructor ends the thread.
class LiveRig {
 public:
  using Connect = std::function<Result<std::unique_ptr<RigConnection>>()>;

  explicit LiveRig(Connect connect);
  ~LiveRig();
  LiveRig(const LiveRig&) = delete;
  LiveRig& operator=(const LiveRig&) = delete;

  /// Waits for the first raymap. Errors: why there is none after `at_most`; kCancelled after Ctrl-C.
  Result<media::Raymap> first(Duration at_most);
  Answer answer(const Wanted& wanted);
  /// Called after each raymap, on the thread of this object; when on_newer({}) has returned, it is not called again.
  void on_newer(std::function<void()> call);
  /// The newest raymap; nothing before the first.
  std::optional<media::Raymap> newest();

  static constexpr std::chrono::milliseconds kWait{1000};
  /// For so long after the last question raymaps are pulled: the rig then encodes none for this program.
  static constexpr Duration kWanted = Duration::seconds(5);

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
  bool wanted(Duration now);
  /// Until somebody asks. False: the object ends.
  bool wait_for_questions();

  const Connect connect_;
  std::mutex on_newer_mutex_;  ///< protects on_newer_
  std::function<void()> on_newer_;
  std::mutex mutex_;  ///< protects all below
  std::condition_variable changed_;
  Newest newest_;
  std::string problem_ = "no answer of the rig yet";
  Duration asked_at_;               ///< time of the last question
  std::optional<Duration> offset_;  ///< the rig's clock minus this computer's; nothing: unknown
  bool stops_ = false;
  std::thread thread_;
};

}  // namespace nodal::host::look
