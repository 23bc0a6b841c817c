// Answers the requests of paired devices.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "host_tool/look/live_rig.h"
#include "host_tool/look/server.h"
#include "host_tool/look/sphere.h"
#include "host_tool/web/devices.h"
#include "host_tool/web/download.h"
#include "host_tool/web/rig_desk.h"

namespace nodal::host::web {

/// GET changes nothing; no request starts a program, names a path or writes configuration. Without a device's cookie,
/// or its secret as a bearer token for GET, only the page that pairs a device and `healthz` are answered:
///   pair, healthz                         a page; "ok", or 503 when the rig does not answer
///   (empty), page files                   the page
///   live?after=N                          LiveRig's answers
///   scene.json, mesh.glb?envelope=K       Sphere's answers for the newest raymap
///   api/me                                the device's name and rights
///   api/status, api/state, api/takes      JSON as of `nodal --json`; api/state: status, heads and exposure together
///   takes/N, takes/N/FILE                 the files of a take; one of them, with Range (operate)
///   thumbs/N                              the thumbnail of a take
///   metrics                               the rig's state for Prometheus
/// POST: api/pair, and of a device that may operate api/OPERATION (operations.h).
///
/// Threading: respond() on the server's thread; what it returns as work on the worker thread.
/// Ownership: owns its connections to the rig.
/// Errors: answers with a sentence.
class Web {
 public:
  Web(RigDesk::Connect connect, std::filesystem::path devices);
  /// For a server whose link alone lets in: whoever asks is this device, and none is paired.
  Web(RigDesk::Connect connect, Device owner);
  ~Web();
  Web(const Web&) = delete;
  Web& operator=(const Web&) = delete;

  look::Answer respond(const look::Wanted& wanted);
  /// Whom to wake when there is something new. Call it with null before the server ends.
  void set_server(look::Server* server);

  static constexpr const char* kCookie = "__Host-nodal";
  static constexpr unsigned kConnections = 256;  ///< behind a server in front, which limits those of each browser

 private:
  Web(RigDesk::Connect connect, std::filesystem::path devices, std::optional<Device> owner);
  std::optional<Device> device_of(const look::Wanted& wanted);
  look::Answer read(const look::Wanted& wanted, const Device& device);
  look::Answer change(const look::Wanted& wanted);
  look::Answer pair(const look::Wanted& wanted);
  look::Answer scene(const look::Wanted& wanted);
  look::Answer take(const look::Wanted& wanted);
  look::Answer take_file(const look::Wanted& wanted, std::uint64_t number, const std::string& file);
  void wake();

  Devices devices_;
  const std::optional<Device> owner_;
  RigDesk desk_;
  std::mutex server_mutex_;  ///< protects server_
  look::Server* server_ = nullptr;
  std::unique_ptr<look::Sphere> sphere_;  ///< worker thread, and the next
  std::string sphere_of_;                 ///< layout and size
  std::unique_ptr<Downloads> downloads_;
  std::unique_ptr<look::LiveRig> live_;
};

}  // namespace nodal::host::web
