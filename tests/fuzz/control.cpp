// All that hosts may do to a rig, through Control: requests of every kind with extreme values and unknown fields,
// frames and bytes that are not requests, uploads, unread pulls, connections, restarts, a full disk, time. The input is
// a sequence of operations on a whole small rig; stand.h lists the checks after each of them.
#include <algorithm>

#include "draw_request.h"
#include "protocol/upload.h"
#include "tests/fuzz/live_heap.h"
#include "tests/fuzz/stand.h"
#include "tests/fuzz/telling.h"

namespace {

using namespace nodal;
using namespace nodal::fuzz;

constexpr std::size_t kMaxOperations = 40;
constexpr std::size_t kMaxGuests = 12;  ///< more than the rig accepts
constexpr std::size_t kMaxVandals = 4;
constexpr int kMaxLongChecks = 1;
constexpr unsigned kCalibratedOneIn = 64;
constexpr Duration kAfterwards = Duration::milliseconds(200);

class Operations {
 public:
  /// Most inputs use a rig without a calibration, which starts thirty times faster because it compiles no table.
  explicit Operations(std::span<const std::uint8_t> input)
      : in_(input),
        stand_(in_.u8() % kCalibratedOneIn == 0 ? Stand::new_disk() : std::make_unique<hal::sim::SimDisk>()) {}

  void run() {
    for (std::size_t i = 0; i < kMaxOperations && in_.left() > 0; ++i) {
      act(in_.u8());
      stand_.check();
    }
    stand_.run(kAfterwards);
    if (last_.ByteSizeLong() > 0) stand_.check_repeated(last_);
    stand_.check_left_behind();
  }

 private:
  void act(unsigned what) {
    switch (what % 16) {
      case 0: return come_or_go();
      case 1:
      case 2:
      case 3: return post(draw_request(in_), 1);
      case 4: return post_again();
      case 5: return post_raw();
      case 6: return vandalize_frame();
      case 7: return vandalize_bytes();
      case 8: return upload();
      case 9: return upload_junk();
      case 10: return stop_reading();
      case 11: return pass_time();
      case 12:
        return stand_.jump(Duration::nanoseconds(static_cast<std::int64_t>(telling(in_, 47))));  // up to 39 hours
      case 13: return restart();
      case 14: return recover();
      default: return change_disk();
    }
  }

  /// Mostly less than a second; some faults of a rate appear only after several seconds.
  void pass_time() {
    constexpr unsigned kLong = 0xF0;
    const unsigned how = in_.u8();
    stand_.run(how < kLong ? Duration::milliseconds(1 + how * 4) : Duration::seconds(1 + how - kLong));
  }

  Guest* guest() {
    auto& all = stand_.guests();
    const unsigned which = in_.u8();
    if (all.empty()) stand_.connect();
    return all.empty() ? nullptr : all[which % all.size()].get();
  }

  void come_or_go() {
    const unsigned what = in_.u8();
    auto& all = stand_.guests();
    if (what % 4 != 0 && all.size() < kMaxGuests) {
      stand_.connect();
    } else if (!all.empty()) {
      all.erase(all.begin() + static_cast<std::ptrdiff_t>(what / 4 % all.size()));
      stand_.settle();
    }
  }

  void post(const wire::Request& request, unsigned times) {
    Guest* const host = guest();
    for (unsigned i = 0; host && i < times; ++i) {
      if (!host->post(request, stand_.served())) break;
      if (i % 8 == 7) stand_.settle();  // a client may not have more requests open
    }
    stand_.settle();
    last_ = request;
  }

  /// Many times, because small leaks add up.
  void post_again() {
    constexpr std::size_t kLarge = 2048;
    post(last_, 1 + in_.u8() % (last_.ByteSizeLong() < kLarge ? 64 : 32));
  }

  /// The input's bytes unchanged, if they are a message at all.
  void post_raw() {
    wire::Request request;
    if (request.ParsePartialFromString(text(in_))) post(request, 1);
  }

  Vandal& vandal() {
    auto& all = stand_.vandals();
    const unsigned which = in_.u8();
    if (all.empty() || (which % 8 == 7 && all.size() < kMaxVandals)) return stand_.intrude();
    return *all[which % all.size()];
  }
  void vandalize_frame() {
    Vandal& host = vandal();
    const std::uint8_t type = in_.u8();
    const std::uint32_t stream = telling32(in_) % 4;
    const std::string payload = text(in_);
    host.send_frame(type, stream, std::span(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size()));
    stand_.settle();
  }
  void vandalize_bytes() {
    Vandal& host = vandal();
    const std::string bytes = text(in_);
    host.send_bytes(std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
    stand_.settle();
  }

  /// A calibration with any name, permanently or on trial. Few of them fit the rig, because compiling a table takes the
  /// time of a hundred requests; the others lack a head.
  void upload() {
    const unsigned how = in_.u8();
    std::string json = document(how < 0xE0, how % 2);
    const std::string& name = Stand::calibrations()[how % 2].name;
    if (how & 2) json.replace(json.find(name), name.size(), "n" + std::to_string(in_.u8()));
    std::optional<std::uint64_t> trial;
    if (how & 4) trial = how & 8 ? telling(in_) : 2'000'000'000;
    send_document({json.begin(), json.end()}, json.size(), trial);
  }
  /// Serialized once each, because that takes the time of ten requests.
  static const std::string& document(bool short_of_a_head, std::size_t which) {
    static const auto made = [] {
      std::array<std::array<std::string, swarm::kCalibrations>, 2> all;
      for (std::size_t i = 0; i < swarm::kCalibrations; ++i) {
        Calibration calibration = Stand::calibrations()[i];
        all[0][i] = to_json(calibration);
        calibration.heads.pop_back();
        all[1][i] = to_json(calibration);
      }
      return all;
    }();
    return made[short_of_a_head ? 1 : 0][which];
  }
  void upload_junk() {
    constexpr std::size_t kMax = 128U << 10;
    const std::size_t length = telling(in_, 17) % kMax;
    std::vector<std::uint8_t> bytes(length, in_.u8());
    for (std::size_t i = 0; i < std::min<std::size_t>(8, length); ++i) bytes[i] = in_.u8();
    send_document(bytes, in_.u8() % 2 == 0 ? length : telling(in_), std::nullopt);
  }
  void send_document(std::vector<std::uint8_t> bytes, std::uint64_t length, std::optional<std::uint64_t> trial_ns) {
    Guest* const host = guest();
    if (!host) return;
    stand_.expect_bytes(4 * bytes.size());  // received, parsed, stored, and its previous generation
    const std::string name = sha256_to_wire(sha256(bytes));
    wire::Request request;
    request.mutable_upload_begin()->set_length(length);
    request.mutable_upload_begin()->set_sha256(name);
    (void)host->post(request, stand_.served());
    wire::UploadPart part;
    part.set_sha256(name);
    host->send_item(part.SerializeAsString(), std::move(bytes));
    stand_.settle();
    request.mutable_upload_commit()->set_sha256(name);
    if (trial_ns) request.mutable_upload_commit()->set_trial_ns(*trial_ns);
    (void)host->post(request, stand_.served());
    stand_.settle();
  }

  void stop_reading() {
    Guest* const host = guest();
    if (host) host->set_reading(!host->reading(), stand_.served());
  }

  void recover() {
    if (long_checks_left_-- > 0) stand_.check_recovery();
  }
  void restart() {
    const unsigned how = in_.u8();
    if (long_checks_left_-- <= 0) return;
    if (how % 4 != 0) return stand_.check_restart();
    stand_.disk_fails(true);  // unsynced data may be lost
    stand_.restart(stand_.disk().after_power_loss(how));
  }

  void change_disk() {
    const unsigned how = in_.u8();
    stand_.disk_fails(true);
    if (how % 2 == 0) stand_.disk().set_capacity(how & 2 ? 0 : std::uint64_t{1} << 40);
    else stand_.disk().fail_at(stand_.disk().operations() + how / 2);
  }

  ByteReader in_;
  Stand stand_;
  wire::Request last_;
  int long_checks_left_ = kMaxLongChecks;  ///< each costs seconds of virtual time
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool kept = (keep_freed_memory(), true);
  (void)kept;
  Operations(std::span(data, size)).run();
  return 0;
}
