// What the page asks of the rig, over one connection for all viewers.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/take/documents.h"

namespace nodal::host::web {

/// Connects when it is asked, and again after the connection was lost. What viewers ask often is asked of the rig once
/// for all of them.
///
/// Threading: thread-bound, to the server's worker thread.
/// Ownership: owns the connection.
/// Errors: those of the rig and of the connection.
class RigDesk {
 public:
  using Connect = std::function<Result<std::unique_ptr<RigConnection>>()>;
  explicit RigDesk(Connect connect) : connect_(std::move(connect)) {}

  struct State {
    wire::RigStatus status;
    wire::Heads heads;
    wire::ExposureState exposure;
    std::string rig_name;
  };
  /// At most kFresh old.
  Result<State> state();
  Result<wire::Takes> takes();
  /// The files of a finished take, by its manifest. The lists of the newest kLists takes that were asked for are kept.
  Result<std::vector<take::Manifest::File>> files(std::uint64_t take);
  /// A small file of a take, such as its thumbnail.
  Result<std::vector<std::uint8_t>> small_file(std::uint64_t take, const std::string& file, std::size_t limit);
  /// Sends a request that changes the rig, `on_behalf` of a device. It is sent once: if the connection is lost before
  /// the answer, the rig may have done it or not, and the error says so.
  Result<wire::Reply> change(wire::Request request, const std::string& on_behalf);

  static constexpr Duration kFresh = Duration::milliseconds(250);
  /// A connection that was not used for longer is not trusted: the rig may have closed it.
  static constexpr Duration kTrusted = Duration::seconds(10);
  static constexpr std::size_t kLists = 4;
  static constexpr std::size_t kMaxManifest = 8 << 20;

 private:
  Result<RigConnection*> connection();
  /// A request that changes nothing, which is sent again over a new connection when the first was lost.
  Result<wire::Reply> ask(const wire::Request& request);
  template <class Work>
  auto trying_twice(const Work& work) -> decltype(work(std::declval<RigConnection&>()));

  const Connect connect_;
  std::unique_ptr<RigConnection> rig_;
  Duration used_at_;
  std::optional<State> state_;
  Duration state_at_;
  std::map<std::uint64_t, std::vector<take::Manifest::File>> lists_;
};

}  // namespace nodal::host::web
