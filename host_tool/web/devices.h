// The devices that may use the page: codes that pair one, and what is kept of it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host::web {

enum class Rights : std::uint8_t {
  kWatch,    ///< see the sphere, heads and the state
  kOperate,  ///< also record, set exposure, download takes
};
std::string_view rights_name(Rights rights);

/// A phone, tablet or computer that was paired. Its secret is not kept, only the secret's SHA-256.
struct Device {
  std::uint64_t number = 0;  ///< counts all devices; `nodal-web revoke` takes it
  std::string name;          ///< as its user wrote it: a claim
  Rights rights = Rights::kWatch;
  std::string hash;           ///< SHA-256 of its secret, 64 hexadecimal digits
  std::int64_t paired_s = 0;  ///< seconds since 1970
  std::int64_t seen_s = 0;    ///< time of its last request, within a day
};

/// The file `devices.json` in a folder, which `nodal-web` on the command line and the server share. Each change locks
/// the folder, reads the file, and replaces it as a whole; so a device that is revoked is refused at its next request.
///
/// Threading: for any thread.
/// Ownership: none.
/// Errors: kIo, kBadFormat for a damaged file, both naming it; kOverload over a limit.
class Devices {
 public:
  /// Seconds since 1970.
  using Clock = std::int64_t (*)();

  explicit Devices(std::filesystem::path folder, Clock clock = &now_s) : folder_(std::move(folder)), clock_(clock) {}

  /// A new code, kCodeDigits hexadecimal digits: good once, for kCodeGood, until kWrongCodes wrong ones were tried.
  Result<std::string> make_code(Rights rights);
  struct Paired {
    std::string secret;
    Device device;
  };
  /// Turns a code into a device with a secret of its own. Errors: kNotFound for a wrong code, also if it was used or is
  /// too old; kBadValue for a name that is empty, too long or not printable.
  Result<Paired> pair(const std::string& code, const std::string& name);
  /// The device with this secret; nothing if there is none, or if it was not used for kIdle.
  std::optional<Device> find(const std::string& secret);
  Result<std::vector<Device>> list();
  /// Errors: kNotFound.
  Status revoke(std::uint64_t number);

  static std::int64_t now_s();

  static constexpr std::size_t kMaxDevices = 64;  ///< beyond, the one that was not seen for longest is forgotten
  static constexpr std::size_t kMaxCodes = 8;     ///< beyond, the oldest ends
  static constexpr std::size_t kMaxName = 40;     ///< bytes; fits into wire::Request.on_behalf
  static constexpr std::size_t kCodeDigits = 32;
  static constexpr int kWrongCodes = 5;
  static constexpr std::chrono::seconds kCodeGood{600};
  static constexpr std::chrono::seconds kIdle{std::chrono::days(30)};
  static constexpr std::size_t kMaxFile = 64 << 10;

 private:
  struct Code {
    std::string hash;
    Rights rights = Rights::kWatch;
    std::int64_t ends_s = 0;
    int wrong_left = kWrongCodes;
  };
  struct Kept {
    std::uint64_t newest = 0;  ///< number of the newest device
    std::vector<Device> devices;
    std::vector<Code> codes;
  };
  /// When the file was last replaced.
  struct Version {
    std::uint64_t file = 0;
    std::int64_t changed_ns = 0;
    friend bool operator==(const Version&, const Version&) = default;
  };
  std::filesystem::path file() const { return folder_ / "devices.json"; }
  Result<Kept> read() const;
  Status write(const Kept& kept) const;
  /// Reads, changes and writes, with the folder locked against other processes. What `change` returns an error for is
  /// written nevertheless.
  template <class Change>
  auto locked(const Change& change) -> decltype(change(std::declval<Kept&>()));

  const std::filesystem::path folder_;
  const Clock clock_;
  std::mutex mutex_;
  std::optional<Version> version_;  ///< version of `kept_`
  Kept kept_;
};

}  // namespace nodal::host::web
