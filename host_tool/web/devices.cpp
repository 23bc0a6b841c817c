#include "host_tool/web/devices.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>

#include "hal/linux/link/descriptor_link.h"
#include "host_tool/console/files.h"
#include "host_tool/web/header_values.h"
#include "protocol/base/sha256.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"
#include "protocol/strict_json.h"

namespace nodal::host::web {
namespace {

constexpr std::int64_t kDay = 86'400;

std::string hash_of(std::string_view secret) {
  return to_hex(sha256({reinterpret_cast<const std::uint8_t*>(secret.data()), secret.size()}));
}

Result<std::string> random_hex(std::size_t digits) {
  std::array<std::uint8_t, 32> bytes{};
  const std::size_t count = digits / 2;
  if (::getrandom(bytes.data(), count, 0) != static_cast<ssize_t>(count))
    return fail(Errc::kIo, "the system gives no random numbers");
  std::string text;
  for (const std::uint8_t byte : std::span(bytes).first(count)) text += fmt::format("{:02x}", byte);
  return text;
}

tl::unexpected<Error> io_error(const std::filesystem::path& file, const char* what) {
  return fail(Errc::kIo, fmt::format("{}: {}: {}", file.string(), what, std::strerror(errno)));
}

Rights rights_of(const nlohmann::json& entry) {
  return entry.value("rights", "") == rights_name(Rights::kOperate) ? Rights::kOperate : Rights::kWatch;
}

Status write_all(std::FILE* to, std::string_view bytes, const std::filesystem::path& file) {
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), to) == bytes.size() && std::fflush(to) == 0;
  return written && ::fsync(::fileno(to)) == 0 ? Status() : io_error(file, "cannot be written");
}

}  // namespace

std::string_view rights_name(Rights rights) { return rights == Rights::kOperate ? "operate" : "watch"; }

std::int64_t Devices::now_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Result<Devices::Kept> Devices::read() const {
  std::error_code none;
  if (!std::filesystem::exists(file(), none)) return Kept{};
  NODAL_TRY_ASSIGN(const std::string text, read_file(file().string(), kMaxFile));
  const auto word = JsonShape::value(64);
  const auto device = JsonShape::object(
      {{"number", word}, {"name", word}, {"rights", word}, {"hash", word}, {"paired_s", word}, {"seen_s", word}});
  const auto code = JsonShape::object({{"rights", word}, {"hash", word}, {"ends_s", word}, {"wrong_left", word}});
  const auto shape = JsonShape::object({{"newest", word},
                                        {"devices", JsonShape::list(kMaxDevices, device)},
                                        {"codes", JsonShape::list(kMaxCodes, code)}});
  const auto parsed = parse_strict_json(text, {kMaxFile, 4}, shape);
  if (!parsed) return fail(parsed.error().in(file().string()));
  const auto is_damaged = [&] {
    const auto is_list = [&](const char* key) { return parsed->contains(key) && parsed->at(key).is_array(); };
    return !parsed->is_object() || !is_list("devices") || !is_list("codes") ||
           parsed->at("devices").size() > kMaxDevices || parsed->at("codes").size() > kMaxCodes;
  };
  const auto damaged = [&] {
    return fail(Errc::kBadFormat, file().string() + ": is damaged; remove it and pair the devices again");
  };
  if (is_damaged()) return damaged();
  try {
    Kept kept{parsed->at("newest").get<std::uint64_t>(), {}, {}};
    for (const nlohmann::json& each : parsed->at("devices")) {
      kept.devices.push_back({each.at("number").get<std::uint64_t>(), each.at("name").get<std::string>(),
                              rights_of(each), each.at("hash").get<std::string>(),
                              each.at("paired_s").get<std::int64_t>(), each.at("seen_s").get<std::int64_t>()});
    }
    for (const nlohmann::json& each : parsed->at("codes")) {
      kept.codes.push_back({each.at("hash").get<std::string>(), rights_of(each), each.at("ends_s").get<std::int64_t>(),
                            each.at("wrong_left").get<int>()});
    }
    return kept;
  } catch (const nlohmann::json::exception&) {
    return damaged();
  }
}

/// The new file belongs to whom the folder belongs to, so that the server reads what root wrote.
Status Devices::write(const Kept& kept) const {
  nlohmann::json document{
      {"newest", kept.newest}, {"devices", nlohmann::json::array()}, {"codes", nlohmann::json::array()}};
  for (const Device& each : kept.devices) {
    document["devices"].push_back({{"number", each.number},
                                   {"name", each.name},
                                   {"rights", rights_name(each.rights)},
                                   {"hash", each.hash},
                                   {"paired_s", each.paired_s},
                                   {"seen_s", each.seen_s}});
  }
  for (const Code& each : kept.codes) {
    document["codes"].push_back({{"hash", each.hash},
                                 {"rights", rights_name(each.rights)},
                                 {"ends_s", each.ends_s},
                                 {"wrong_left", each.wrong_left}});
  }
  const std::filesystem::path next = folder_ / "devices.next";
  ::unlink(next.c_str());  // what a stopped program left
  const Result<FilePtr> out = create_to_write(next);
  if (!out) return fail(out.error().in(next.string()));
  const int descriptor = ::fileno(out->get());
  if (::fchmod(descriptor, 0600) != 0) return io_error(next, "its mode cannot be set");
  struct stat folder {};
  if (::stat(folder_.c_str(), &folder) == 0 && ::geteuid() == 0 &&
      ::fchown(descriptor, folder.st_uid, folder.st_gid) != 0) {
    return io_error(next, "its owner cannot be set");
  }
  NODAL_TRY(write_all(out->get(), document.dump(1) + "\n", next));
  return ::rename(next.c_str(), file().c_str()) == 0 ? Status() : io_error(file(), "cannot be replaced");
}

template <class Change>
auto Devices::locked(const Change& change) -> decltype(change(std::declval<Kept&>())) {
  const std::lock_guard lock(mutex_);
  const hal::Descriptor folder(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() < 0 || ::flock(folder.get(), LOCK_EX) != 0) return io_error(folder_, "cannot be opened and locked");
  NODAL_TRY_ASSIGN(Kept kept, read());
  std::erase_if(kept.codes, [&](const Code& code) { return clock_() >= code.ends_s || code.wrong_left <= 0; });
  std::erase_if(kept.devices, [&](const Device& device) { return clock_() - device.seen_s > kIdle.count(); });
  auto changed = change(kept);
  NODAL_TRY(write(kept));
  return changed;
}

Result<std::string> Devices::make_code(Rights rights) {
  NODAL_TRY_ASSIGN(const std::string code, random_hex(kCodeDigits));
  return locked([&](Kept& kept) -> Result<std::string> {
    if (kept.codes.size() >= kMaxCodes) kept.codes.erase(kept.codes.begin());
    kept.codes.push_back({hash_of(code), rights, clock_() + kCodeGood.count(), kWrongCodes});
    return code;
  });
}

Result<Devices::Paired> Devices::pair(const std::string& code, const std::string& name) {
  if (name.empty() || name.size() > kMaxName || !is_printable(name) || name.find('"') != std::string::npos) {
    return fail(Errc::kBadValue, fmt::format("a device's name has 1 to {} bytes, without quotation marks", kMaxName));
  }
  NODAL_TRY_ASSIGN(const std::string secret, random_hex(kSecretDigits));
  return locked([&](Kept& kept) -> Result<Paired> {
    // Hashes are compared, so that the time of the comparison tells nothing about a code.
    const auto found = std::ranges::find(kept.codes, hash_of(code), &Code::hash);
    if (found == kept.codes.end()) {
      for (Code& each : kept.codes) --each.wrong_left;
      return fail(Errc::kNotFound,
                  "this code is wrong, was used, or is older than ten minutes; make a new one on the rig: "
                  "nodal-web pair");
    }
    const std::int64_t now = clock_();
    const Paired paired{secret, {++kept.newest, name, found->rights, hash_of(secret), now, now}};
    kept.codes.erase(found);
    if (kept.devices.size() >= kMaxDevices)
      kept.devices.erase(std::ranges::min_element(kept.devices, {}, &Device::seen_s));
    kept.devices.push_back(paired.device);
    return paired;
  });
}

std::optional<Device> Devices::find(const std::string& secret) {
  const std::int64_t now = clock_();
  std::optional<Device> found;
  {
    const std::lock_guard lock(mutex_);
    struct stat state {};
    if (::stat(file().c_str(), &state) != 0) return std::nullopt;
    const Version version{state.st_ino, state.st_mtim.tv_sec * 1'000'000'000 + state.st_mtim.tv_nsec};
    if (version_ != version) {
      Result<Kept> kept = read();
      if (!kept) return std::nullopt;
      kept_ = std::move(*kept);
      version_ = version;
    }
    const auto device = std::ranges::find(kept_.devices, hash_of(secret), &Device::hash);
    if (device == kept_.devices.end() || now - device->seen_s > kIdle.count()) return std::nullopt;
    found = *device;
  }
  if (now - found->seen_s < kDay) return found;
  const auto seen = locked([&](Kept& kept) -> Status {
    for (Device& each : kept.devices) {
      if (each.number == found->number) each.seen_s = now;
    }
    return {};
  });
  return seen ? found : std::nullopt;
}

Result<std::vector<Device>> Devices::list() {
  return locked([&](Kept& kept) -> Result<std::vector<Device>> { return kept.devices; });
}

Status Devices::revoke(std::uint64_t number) {
  return locked([&](Kept& kept) -> Status {
    if (std::erase_if(kept.devices, [&](const Device& each) { return each.number == number; }) > 0) return {};
    return fail(Errc::kNotFound, fmt::format("there is no device {}; `nodal-web devices` lists them", number));
  });
}

}  // namespace nodal::host::web
