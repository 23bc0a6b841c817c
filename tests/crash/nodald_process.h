// The real nodald, as a process with its own folder, and a host that talks to it.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/link.h"
#include "protocol/session.h"

namespace nodal::crash {

/// A temporary folder with truth.json and rig.toml of the small rig.
class RigFolder {
 public:
  RigFolder();
  ~RigFolder();
  std::filesystem::path path;
  std::string config() const { return (path / "rig.toml").string(); }
  std::string socket() const { return (path / "sock").string(); }
};

/// A rig that records takes into this folder; `more` lines of its [takes].
struct RecordingRig : RigFolder {
  explicit RecordingRig(const std::string& takes = "takes", const std::string& more = "");
};

/// nodald with these arguments.
std::vector<std::string> nodald(std::vector<std::string> arguments);

/// A host over any link.
class LinkHost {
 public:
  explicit LinkHost(std::unique_ptr<hal::LinkPort> link);
  /// Connects to a nodald that may still be starting; null if none answers in time.
  static std::unique_ptr<LinkHost> connect(const std::string& socket, int seconds = 30);

  std::optional<wire::Reply> ask(wire::Request request, int seconds = 30);
  /// Asks what this fills in.
  std::optional<wire::Reply> ask(const std::function<void(wire::Request&)>& fill);
  void post(wire::Request request);
  /// Does an upload except for waiting for its answer.
  bool upload_and_commit(const std::string& document);
  std::optional<wire::RigStatus> status();
  /// Asks for the status until it is so; false after a minute, and if the link is closed.
  bool wait_for(const std::function<bool(const wire::RigStatus&)>& holds);
  /// Waits briefly for bytes in either direction; false if the link is closed.
  bool pump();
  std::optional<wire::Reply> take_reply(std::uint64_t id);
  std::uint64_t last_id() const { return next_id_ - 1; }

  std::size_t raymaps = 0;  ///< complete raymaps that were pulled

 private:
  std::unique_ptr<hal::LinkPort> link_;
  Session session_;
  std::vector<wire::Reply> replies_;
  std::uint64_t next_id_ = 1;
};

}  // namespace nodal::crash
