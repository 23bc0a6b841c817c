// The rig's end of the cable: sessions of hosts, one at a time, over a UsbFunction.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "hal/link.h"
#include "hal/linux/cable/function.h"
#include "hal/linux/cable/receive_ring.h"
#include "hal/linux/cable/records.h"
#include "protocol/base/result.h"

namespace nodal::hal::cable {

/// Shared by the listener and the links. Nothing on the bus tells the rig that a host's program was killed: its
/// session stays open until the next host's control request, or until its link is dropped for its silence.
///
/// The control request of a new host ends the session before it: all queued transfers are cancelled, and the request is
/// answered when the last of them has ended. A host sends no data before that answer, and bytes for the host before it
/// are no longer queued after it. So no byte passes from one session to the next.
///
/// Threading: thread-bound to the control stage.
/// Errors: kLinkClosed, kProtocol, and kIo for a function that is no longer there.
class Cable {
 public:
  /// `name`: in messages.
  Cable(std::unique_ptr<UsbFunction> function, std::string name);
  /// Gives the host up to kFarewell to take what is queued for it.
  ~Cable();
  Cable(const Cable&) = delete;
  Cable& operator=(const Cable&) = delete;

  /// The number of a session that was opened since the last call; nothing if there is none.
  Result<std::optional<std::uint64_t>> take_session();
  /// As LinkPort's. Bytes of a session are lost, unread ones too, when another host opens the cable.
  Result<std::size_t> read(std::uint64_t session, std::span<std::uint8_t> into);
  Result<std::size_t> write(std::uint64_t session, std::span<const std::uint8_t> from);
  /// Call it when the session's link is destroyed. The host gets the bytes that were written, then the end of the
  /// session.
  void close(std::uint64_t session);

  /// As LinkPort's and LinkListenerPort's.
  void add_wake_ups(std::uint64_t session, WakeUps& to, bool to_read, bool to_write) const;
  void add_wake_ups(WakeUps& to) const;

  const std::string& name() const { return name_; }

  static constexpr Duration kFarewell = Duration::milliseconds(200);
  static constexpr int kEventsAPump = 16;  ///< leaves time for other work when a host sends requests without a pause

 private:
  void pump();
  void handle(const FunctionEvent& event);
  void complete(const Completion& completion);
  void begin_session();
  void end_session(const std::string& why);
  bool over() const { return why_ || broken_ || received_.violation() || received_.ended(); }
  /// Queues one record; returns the payload it took, 0 if all slots are in use.
  std::size_t queue_record(std::span<const std::uint8_t> payload);
  tl::unexpected<Error> closed(std::uint64_t session) const;

  std::unique_ptr<UsbFunction> function_;
  std::string name_;
  std::optional<Error> broken_;  ///< the function itself
  bool opening_ = false;         ///< a host waits for the answer to its control request

  std::uint64_t session_ = 0;  ///< counts; its low 16 bits are in the records
  bool handed_out_ = true;
  bool abandoned_ = false;          ///< its link was dropped
  bool last_record_due_ = false;    ///< the record that ends the session is not queued yet
  std::optional<std::string> why_;  ///< the session's end

  ReceiveRing received_;
  std::array<bool, kTransfers> writing_{};
  std::size_t writes_queued_ = 0;
};

/// Listens at a FunctionFS folder, such as "/run/nodal_cable", whose gadget firmware/daemon/cable has set up; it must
/// be bound to a USB device controller after this call. `rig` is shown to hosts as the interface's name.
/// Errors: kNotFound, kBusy and kIo, each with what to do.
Result<std::unique_ptr<LinkListenerPort>> listen_cable(const std::string& folder, const std::string& rig);

/// The same over any function: for tests.
std::unique_ptr<LinkListenerPort> listen_over(std::unique_ptr<UsbFunction> function, const std::string& name);

}  // namespace nodal::hal::cable
