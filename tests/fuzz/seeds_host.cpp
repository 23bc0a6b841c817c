// Writes the seeds of rig_replies, png and jpeg into corpus/: one valid conversation for every command, and invalid
// frames of every kind. Run it again after commands or messages changed: fuzz_seeds_host tests/fuzz/corpus
#include <climits>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/sha256.h"
#include "protocol/calibration.h"
#include "protocol/framing.h"
#include "protocol/nodal.pb.h"
#include "tests/support/pictures.h"
#include "tests/support/rigs.h"

namespace nodal {
namespace {

namespace fs = std::filesystem;

// The same numbers as in commands() of rig_replies.cpp.
enum Command : char {
  kStatus,
  kHeads,
  kHeadSet,
  kExposureShow,
  kExposureSet,
  kGenlock,
  kCalibrationList,
  kCalibrationShow,
  kCalibrationRollback,
  kPullJpeg,
  kPullPng,
  kSync,
  kDrift,
  kHosts,
  kAudit,
  kScan,
  kLatency
};
constexpr char kText = 0;
constexpr char kJson = 1;

/// Builds an input of rig_replies, frame by frame.
class Talk {
 public:
  Talk(Command command, char flags) : bytes_{static_cast<char>(command), flags} {}

  Talk& frame(FrameType type, char stream, const std::string& payload) {
    bytes_ += static_cast<char>(type);
    bytes_ += stream;
    bytes_ += static_cast<char>(payload.size() & 0xFF);
    bytes_ += static_cast<char>(payload.size() >> 8 & 0xFF);
    bytes_ += payload;
    return *this;
  }
  Talk& reply(const wire::Reply& reply) { return frame(FrameType::kReply, 0, reply.SerializeAsString()); }
  Talk& open(bool lossless) {
    wire::StreamOpen open;
    open.set_policy(lossless ? 1 : 2);
    return frame(FrameType::kStreamOpen, 2, open.SerializeAsString());
  }
  Talk& started() {
    wire::Reply pull;
    pull.mutable_pull()->set_stream(2);
    return reply(pull);
  }
  /// A whole item, or the first piece of one with `total` announced bytes.
  Talk& item(std::uint64_t number, const std::string& meta, const std::string& body, std::uint64_t total) {
    std::string payload;
    for (const auto& [value, size] : {std::pair(number, 8), std::pair(std::uint64_t{meta.size() + total}, 8),
                                      std::pair(std::uint64_t{0}, 8), std::pair(std::uint64_t{meta.size()}, 4)}) {
      for (int i = 0; i < size; ++i) payload += static_cast<char>(value >> (8 * i) & 0xFF);
    }
    return frame(FrameType::kBulk, 2, payload + meta + body);
  }
  Talk& close(std::uint64_t offered) {
    wire::StreamClose close;
    close.set_offered(offered);
    return frame(FrameType::kStreamClose, 2, close.SerializeAsString());
  }
  void write(const fs::path& file) const {
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << bytes_;
  }

 private:
  std::string bytes_;
};

void add_counts(google::protobuf::RepeatedPtrField<wire::Count>& counts) {
  for (const char* reason : {"late", "a\x1b[2J\n"}) {
    wire::Count& count = *counts.Add();
    count.set_reason(reason);
    count.set_frames(UINT64_MAX);
  }
}

wire::Reply status() {
  wire::Reply reply;
  wire::RigStatus& s = *reply.mutable_status();
  s.set_state("running");
  s.set_activity("compiling");
  s.set_problem(
      "a sentence\r\nnodal: all is well\xC2\x9B"
      "2J");
  s.set_calibration_id(std::string(32, 'i'));
  s.set_calibration_name("six");
  s.mutable_genlock()->set_state("locked");
  s.mutable_genlock()->add_unaligned("cam0 cannot");
  add_counts(*s.mutable_losses());
  add_counts(*s.mutable_publish_drops());
  s.add_marks()->set_at_ns(UINT64_MAX);
  s.mutable_trial()->set_id(std::string(32, 't'));
  return reply;
}

wire::Reply heads(int count) {
  wire::Reply reply;
  for (int i = 0; i < count; ++i) {
    wire::HeadState& head = *reply.mutable_heads()->add_heads();
    head.set_index(static_cast<std::uint32_t>(i));
    head.set_name("cam" + std::to_string(i));
    head.set_problem("gone");
    head.set_skew_ns(INT64_MIN);
    head.set_gain_mdb(INT32_MIN);
    head.set_exposure_ns(UINT64_MAX);
    head.set_drift_ppb(INT32_MIN);
    add_counts(*head.mutable_losses());
  }
  return reply;
}

wire::Reply exposure() {
  wire::Reply reply;
  reply.mutable_exposure()->mutable_settings()->set_program("joint");
  reply.mutable_exposure()->mutable_settings()->set_anchor(INT32_MIN);
  wire::HeadExposure& head = *reply.mutable_exposure()->add_heads();
  head.set_metered(true);
  head.set_light(INT32_MIN);
  head.set_exposure(INT32_MIN);
  return reply;
}

std::string raymap_header(const std::string& coding, std::uint32_t width, std::uint32_t height) {
  wire::RaymapHeader header;
  header.set_coding(coding);
  header.set_width(width);
  header.set_height(height);
  header.set_layout("equirectangular");
  header.set_heads_mask(3);
  header.set_genlock("locked");
  header.add_offset_ns(INT64_MIN);
  header.add_offset_ns(INT64_MAX);
  header.set_spread_ns(UINT64_MAX);
  header.set_trigger(7);
  header.set_begin_spread_ns(5);
  header.set_drift_ppb(INT32_MIN);
  header.set_parity("top");
  return header.SerializeAsString();
}

wire::Reply calibration_of(const Calibration& rig) {
  wire::Reply reply;
  reply.mutable_calibration()->set_json(to_json(rig));
  return reply;
}

void write_answers(const fs::path& corpus) {
  Talk(kStatus, kText).reply(status()).write(corpus / "status");
  Talk(kStatus, kJson).reply(status()).write(corpus / "status-json");
  Talk(kHeads, kText).reply(heads(3)).write(corpus / "heads");
  Talk(kHeads, kJson).reply(heads(3)).write(corpus / "heads-json");
  Talk(kHeads, kText).reply(heads(40)).write(corpus / "heads-too-many");
  wire::Reply done;
  done.mutable_done();
  Talk(kHeadSet, kText).reply(heads(2)).reply(done).write(corpus / "head-set");
  Talk(kExposureShow, kText).reply(exposure()).reply(heads(1)).write(corpus / "exposure");
  Talk(kExposureSet, kJson).reply(heads(1)).reply(exposure()).reply(heads(1)).write(corpus / "exposure-set-json");
  wire::Reply genlock;
  *genlock.mutable_genlock() = status().status().genlock();
  genlock.mutable_genlock()->set_drift_ppb(INT32_MIN);
  Talk(kGenlock, kText).reply(genlock).write(corpus / "genlock");
  wire::Reply list;
  list.mutable_calibrations()->add_entries()->set_in_force(true);
  list.mutable_calibrations()->mutable_entries(0)->set_name("a\tb");
  Talk(kCalibrationList, kText).reply(list).write(corpus / "calibrations");
  Talk(kCalibrationShow, kText).reply(calibration_of(test::ring(3, 64, 48))).write(corpus / "calibration");
  Talk(kCalibrationShow, kJson).reply(calibration_of(test::ring(3, 64, 48))).write(corpus / "calibration-json");
  Talk(kCalibrationRollback, kText).reply(done).reply(list).write(corpus / "rollback");
  wire::Reply hosts;
  wire::HostState& host = *hosts.mutable_hosts()->add_hosts();
  host.set_peer("unix:a\x1b[2J");
  host.set_software("b\n");
  host.add_streams("pulls jpeg");
  host.set_idle_ns(UINT64_MAX);
  Talk(kHosts, kText).reply(hosts).write(corpus / "hosts");
  wire::Reply audit;
  audit.mutable_audit_log()->add_entries()->set_who("c\r\n");
  audit.mutable_audit_log()->mutable_entries(0)->set_at_ns(UINT64_MAX);
  Talk(kAudit, kText).reply(audit).write(corpus / "audit");
  wire::Reply devices;
  devices.mutable_devices()->add_lines("# a\x1b[2J camera");
  devices.mutable_devices()->set_json(R"({"devices":[{"model":"\u009b"}],"rig_toml":"[rig]\nname=1"})");
  for (const char flags : {kText, kJson})
    Talk(kScan, flags).reply(devices).write(corpus / (flags ? "devices-json" : "devices"));
  wire::Reply rate;
  rate.mutable_genlock()->set_rate_numerator(25);
  rate.mutable_genlock()->set_rate_denominator(1);
  wire::Reply given;
  given.mutable_done()->set_at_ns(UINT64_MAX);
  Talk(kLatency, kText).reply(heads(1)).reply(rate).reply(given).open(false).started().write(corpus / "latency");
  wire::Reply error;
  error.mutable_error()->set_code(UINT32_MAX);
  error.mutable_error()->set_message("a\x1b]0;b\x07");
  for (const char flags : {kText, kJson})
    Talk(kStatus, flags).reply(error).write(corpus / (flags ? "error-json" : "error"));
}

void write_streams(const fs::path& corpus) {
  const std::string jpeg("\xFF\xD8\xFF\xE0\xFF\xD9", 6);
  const std::string header = raymap_header("jpeg", 32, 16);
  Talk(kPullJpeg, kText).open(false).started().item(0, header, jpeg, 6).item(1, header, jpeg, 6).write(corpus / "pull");
  Talk(kPullJpeg, kJson).open(false).started().item(0, header, jpeg, 6).close(1).write(corpus / "pull-closed-json");
  Talk(kPullJpeg, kText).open(true).started().item(0, header, jpeg, 1ULL << 31).write(corpus / "pull-announces-2GiB");
  for (const char* coding : {"I420", "NV12", "RGB24", "GREY", "RGB48", "GREY16"}) {
    const std::size_t bytes = packed_size(std::string(coding) == "GREY"     ? PixelFormat::kGrey8
                                          : std::string(coding) == "GREY16" ? PixelFormat::kGrey16
                                          : std::string(coding) == "RGB48"  ? PixelFormat::kRgb48
                                          : std::string(coding) == "RGB24"  ? PixelFormat::kRgb24
                                                                            : PixelFormat::kI420,
                                          32, 16);
    Talk(kPullPng, kText)
        .reply(heads(2))
        .open(false)
        .started()
        .item(0, raymap_header(coding, 32, 16), std::string(bytes, 'x'), bytes)
        .write(corpus / (std::string("pull-") + coding));
  }
  const std::string largest = raymap_header("RGB48", 16384, 8192);
  Talk(kPullPng, kText)
      .reply(heads(2))
      .open(false)
      .started()
      .item(0, largest, "x", 16384ULL * 8192 * 6)
      .write(corpus / "pull-largest-announced");
  const std::string set = raymap_header("none", 32, 16);
  Talk(kSync, kText)
      .reply(heads(2))
      .open(true)
      .started()
      .item(0, set, "", 0)
      .item(1, set, "", 0)
      .item(2, set, "", 0)
      .write(corpus / "sync");
  Talk(kSync, kJson).reply(heads(2)).open(true).started().item(0, set, "", 0).close(1).write(corpus / "sync-json");
  // Frame sets: two heads with 64x48 grey pictures; then a calibration with other sizes.
  Calibration rig = test::ring(2, 64, 48);
  wire::FrameSetHeader frames;
  const Sha256 id = calibration_id(rig);
  frames.set_calibration_id(std::string(id.begin(), id.end()));
  for (std::uint32_t i = 0; i < 2; ++i) {
    wire::HeadPicture& head = *frames.add_heads();
    head.set_name("cam" + std::to_string(i));
    head.set_format("GREY");
    head.set_width(64);
    head.set_height(48);
    head.set_offset(std::uint64_t{i} * 64 * 48);
  }
  const std::string pixels(2 * 64 * 48, 'p');
  const std::string meta = frames.SerializeAsString();
  Talk(kDrift, kText)
      .reply(calibration_of(rig))
      .open(true)
      .started()
      .item(0, meta, pixels, pixels.size())
      .close(1)
      .write(corpus / "drift");
  Talk(kDrift, kText)
      .reply(calibration_of(rig))
      .open(true)
      .started()
      .item(0, meta, pixels, 1'000'000'000)
      .write(corpus / "drift-announces-1GB");
  frames.mutable_heads(1)->set_offset(UINT64_MAX);
  Talk(kDrift, kText)
      .reply(calibration_of(rig))
      .open(true)
      .started()
      .item(0, frames.SerializeAsString(), pixels, pixels.size())
      .close(1)
      .write(corpus / "drift-offset");
  frames.mutable_heads(1)->set_offset(0);
  frames.mutable_heads(1)->set_width(32);
  Talk(kDrift, kText)
      .reply(calibration_of(rig))
      .open(true)
      .started()
      .item(0, frames.SerializeAsString(), std::string(64 * 48 + 32 * 48, 'p'), 64 * 48 + 32 * 48)
      .close(1)
      .write(corpus / "drift-other-size");
}

void write_pictures(const fs::path& png, const fs::path& jpeg) {
  fs::create_directories(png);
  fs::create_directories(jpeg);
  const std::vector<std::uint8_t> rgb = test::smooth_rgb(20, 12);
  const std::vector<std::uint8_t> deep(20 * 12 * 6, 0x5A);
  test::write_bytes(png / "rgb", test::png_of(rgb, 20, 12, 3));
  test::write_bytes(png / "grey", test::png_of(rgb, 20, 36, 1));
  test::write_bytes(png / "rgba", test::png_of(rgb, 20, 9, 4));
  test::write_bytes(png / "rgb16", test::png_of(deep, 20, 12, 3, 16));
  for (const auto& [name, sampling] :
       {std::pair("420", test::Sampling::k420), std::pair("422", test::Sampling::k422),
        std::pair("444", test::Sampling::k444), std::pair("grey", test::Sampling::kGrey)}) {
    std::vector<std::uint8_t> bytes = test::jpeg_of(rgb, 20, 12, sampling);
    test::write_bytes(jpeg / name, bytes);
    // The same file with 32 000 x 32 000 pixels in its header.
    for (std::size_t i = 0; i + 8 < bytes.size(); ++i) {
      if (bytes[i] == 0xFF && bytes[i + 1] == 0xC0) bytes[i + 5] = bytes[i + 7] = 0x7D;
    }
    test::write_bytes(jpeg / (std::string(name) + "-claims-32000"), bytes);
  }
}

}  // namespace
}  // namespace nodal

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "fuzz_seeds_host CORPUS_FOLDER\n");
    return 2;
  }
  const std::filesystem::path corpus = argv[1];
  nodal::write_answers(corpus / "rig_replies");
  nodal::write_streams(corpus / "rig_replies");
  nodal::write_pictures(corpus / "png", corpus / "jpeg");
  return 0;
}
