#include <memory>
#include <utility>

#include "hal/linux/cable/cable.h"
#include "hal/linux/cable/function_fs.h"
#include "protocol/base/try.h"

namespace nodal::hal::cable {
namespace {

class CableLink final : public LinkPort {
 public:
  CableLink(std::shared_ptr<Cable> cable, std::uint64_t session) : cable_(std::move(cable)), session_(session) {}
  ~CableLink() override { cable_->close(session_); }
  CableLink(const CableLink&) = delete;
  CableLink& operator=(const CableLink&) = delete;

  Result<std::size_t> read(std::span<std::uint8_t> into) override { return cable_->read(session_, into); }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override { return cable_->write(session_, from); }
  const std::string& peer() const override { return cable_->name(); }
  std::optional<PeerIdentity> identity() const override { return std::nullopt; }
  void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const override {
    cable_->add_wake_ups(session_, to, to_read, to_write);
  }

 private:
  std::shared_ptr<Cable> cable_;
  std::uint64_t session_;
};

class CableListener final : public LinkListenerPort {
 public:
  explicit CableListener(std::shared_ptr<Cable> cable) : cable_(std::move(cable)) {}

  Result<std::unique_ptr<LinkPort>> accept() override {
    NODAL_TRY_ASSIGN(const auto session, cable_->take_session());
    if (!session) return nullptr;
    return std::make_unique<CableLink>(cable_, *session);
  }
  void add_wake_ups(WakeUps& to) const override { cable_->add_wake_ups(to); }

 private:
  std::shared_ptr<Cable> cable_;
};

}  // namespace

std::unique_ptr<LinkListenerPort> listen_over(std::unique_ptr<UsbFunction> function, const std::string& name) {
  return std::make_unique<CableListener>(std::make_shared<Cable>(std::move(function), name));
}

Result<std::unique_ptr<LinkListenerPort>> listen_cable(const std::string& folder, const std::string& rig) {
  NODAL_TRY_ASSIGN(auto function, open_function(folder, rig));
  return listen_over(std::move(function), "usb:" + folder);
}

}  // namespace nodal::hal::cable
