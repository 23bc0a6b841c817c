// A rig that sends any answer to every nodal command that queries a rig. The input: a byte for the command, a byte of
// flags (bit 0: --json), then frames as (type u8, stream u8, length u16, payload). The Hello goes first, and every
// reply gets the next request's id, so that the commands' handling of answers is fuzzed. Then the link is lost.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "hal/link.h"
#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "memory_limit.h"
#include "protocol/base/bytes.h"
#include "protocol/framing.h"
#include "protocol/session.h"

namespace nodal {
namespace {

constexpr std::size_t kMemory = std::size_t{96} << 20;

/// Returns its bytes, then fails; accepts everything that is written.
class CannedLink final : public hal::LinkPort {
 public:
  explicit CannedLink(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {}
  Result<std::size_t> read(std::span<std::uint8_t> into) override {
    const std::size_t n = std::min(into.size(), bytes_.size() - at_);
    if (n == 0) return fail(Errc::kLinkClosed, "the input ends");
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at_), n, into.begin());
    at_ += n;
    return n;
  }
  Result<std::size_t> write(std::span<const std::uint8_t> from) override { return from.size(); }
  void add_wake_ups(hal::WakeUps&, bool, bool) const override {}
  const std::string& peer() const override { return peer_; }
  std::optional<hal::PeerIdentity> identity() const override { return std::nullopt; }

 private:
  std::vector<std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::string peer_ = "fuzz";
};

void append(std::vector<std::uint8_t>& out, FrameType type, StreamId stream, std::uint32_t sequence,
            std::span<const std::uint8_t> payload) {
  const auto header = encode_frame_header(FrameHeader{type, 0, stream, sequence}, payload);
  out.insert(out.end(), header.begin(), header.end());
  out.insert(out.end(), payload.begin(), payload.end());
}

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::vector<std::uint8_t> conversation(ByteReader& in) {
  wire::Hello hello = make_hello("nodald");
  for (const char* feature : {"frame-sets", "calibration-trial"}) hello.add_features(feature);
  std::vector<std::uint8_t> out;
  std::uint32_t sequence = 0;
  std::uint64_t question = 1;
  append(out, FrameType::kHello, 0, sequence++, bytes_of(hello.SerializeAsString()));
  while (in.left() >= 4) {
    const auto type = static_cast<FrameType>(in.u8());
    const StreamId stream = in.u8();
    const std::size_t length = std::min<std::size_t>(in.u16(), in.left());
    const auto payload = in.bytes(length);
    std::string text(payload.begin(), payload.end());
    if (type == FrameType::kReply) {
      wire::Reply number;  // if a field occurs twice the later value counts
      number.set_id(question++);
      text += number.SerializeAsString();
    }
    if (text.size() <= max_payload_bytes(type)) append(out, type, stream, sequence++, bytes_of(text));
  }
  return out;
}

/// One command line of nodal, created once; its output goes to memory.
class Runner {
 public:
  explicit Runner(std::vector<std::string> words) : words_(std::move(words)) {}

  void run(const std::vector<std::uint8_t>& from_rig, bool json) {
    std::rewind(out_.file);
    std::rewind(err_.file);
    line_.context().connect_by = [&] {
      return host::RigConnection::over(std::make_unique<CannedLink>(from_rig), "fuzz", Duration::seconds(1),
                                       [](hal::LinkPort&, bool, Duration) {});
    };
    std::vector<const char*> words{"nodal"};
    if (json) words.push_back("--json");
    for (const std::string& word : words_) words.push_back(word.c_str());
    line_.context().json = false;
    (void)line_.run(static_cast<int>(words.size()), words.data());
    check(out_.text(), err_.text(), json);
  }

 private:
  struct Memory {
    Memory() : file(open_memstream(&data, &size)) {}
    ~Memory() {
      std::fclose(file);
      std::free(data);
    }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
    std::string text() {
      std::fflush(file);
      return {data, size};
    }
    char* data = nullptr;
    std::size_t size = 0;
    std::FILE* file;
  };

  static void check(const std::string& out, const std::string& err, bool json) {
    NODAL_ASSERT(err.find("not enough memory") == std::string::npos);
    NODAL_ASSERT(err.find("unexpected: ") == std::string::npos);
    NODAL_ASSERT(!has_controls(err));
    if (!json) {
      NODAL_ASSERT(!has_controls(out));
      return;
    }
    for (std::size_t at = 0; at < out.size();) {
      const std::size_t end = out.find('\n', at);
      NODAL_ASSERT(end != std::string::npos);
      NODAL_ASSERT(host::Json::accept(out.substr(at, end - at)));
      at = end + 1;
    }
  }

  /// Standard output and error are not terminals here: no colour and no cursor control.
  static bool has_controls(const std::string& text) {
    for (const char c : text) {
      if ((static_cast<unsigned char>(c) < 0x20 && c != '\n') || c == 0x7F) return true;
    }
    return false;
  }

  std::vector<std::string> words_;
  Memory out_, err_;
  host::Console console_{out_.file, err_.file};
  host::CommandLine line_{console_, host::add_all_commands};
};

const std::vector<std::vector<std::string>>& commands() {
  static const std::vector<std::vector<std::string>> all{
      {"status"},
      {"heads"},
      {"head", "set", "cam0", "--gain", "1dB"},
      {"exposure", "show"},
      {"exposure", "set", "joint", "--anchor", "cam0"},
      {"genlock", "show"},
      {"calibration", "list"},
      {"calibration", "show"},
      {"calibration", "rollback"},
      {"raymap", "pull", "-n", "2", "--out", "/dev/null", "--format", "jpg"},
      {"raymap", "pull", "-n", "2", "--out", "/dev/null", "--format", "png", "--complete"},
      {"sync", "report", "-n", "3", "--svg", "/dev/null"},
      {"drift", "--sets", "1", "--threads", "1"},
      {"hosts"},
      {"audit"},
      {"heads", "scan"},
      {"heads", "latency", "cam0"},
  };
  return all;
}

}  // namespace
}  // namespace nodal

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static std::vector<std::unique_ptr<Runner>> runners = [] {
    std::vector<std::unique_ptr<Runner>> made;
    for (const auto& words : commands()) made.push_back(std::make_unique<Runner>(words));
    return made;
  }();
  static const bool limited = (fuzz::limit_memory(kMemory), true);
  (void)limited;
  if (size < 2 || size > (1U << 16)) return 0;
  ByteReader in({data + 2, size - 2});
  runners[data[0] % runners.size()]->run(conversation(in), (data[1] & 1) != 0);
  return 0;
}
