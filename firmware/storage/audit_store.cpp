#include "firmware/storage/audit_store.h"

#include <fmt/format.h>

#include <charconv>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "firmware/storage/durable_file.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

constexpr std::string_view kHead = "nodal-audit 1 ";
constexpr std::size_t kHexDigits = 64;

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

Sha256 hash_after(const Sha256& before, std::uint64_t number, std::string_view text) {
  const std::string hashed = fmt::format("{} {} {}", to_hex(before), number, text);
  return sha256(bytes_of(hashed));
}

std::optional<Sha256> from_hex(std::string_view hex) {
  Sha256 hash{};
  if (hex.size() != kHexDigits) return std::nullopt;
  for (std::size_t i = 0; i < hash.size(); ++i) {
    const char* const digits = hex.data() + 2 * i;
    const auto [end, error] = std::from_chars(digits, digits + 2, hash[i], 16);
    if (error != std::errc{} || end != digits + 2) return std::nullopt;
  }
  return hash;
}

struct Line {
  Sha256 hash{};
  std::uint64_t number = 0;
  std::string_view text;
};

/// "<hash> <number> <text>".
std::optional<Line> parse_line(std::string_view line) {
  if (line.size() < kHexDigits + 3 || line[kHexDigits] != ' ') return std::nullopt;
  const auto hash = from_hex(line.substr(0, kHexDigits));
  line.remove_prefix(kHexDigits + 1);
  Line parsed;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), parsed.number);
  if (!hash || error != std::errc{} || end == line.data() + line.size() || *end != ' ') return std::nullopt;
  parsed.hash = *hash;
  parsed.text = line.substr(static_cast<std::size_t>(end - line.data()) + 1);
  return parsed;
}

/// "nodal-audit 1 <number> <hash>".
std::optional<Line> parse_head(std::string_view line) {
  if (!line.starts_with(kHead)) return std::nullopt;
  line.remove_prefix(kHead.size());
  Line parsed;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), parsed.number);
  if (error != std::errc{} || end == line.data() + line.size() || *end != ' ') return std::nullopt;
  const auto hash = from_hex(line.substr(static_cast<std::size_t>(end - line.data()) + 1));
  if (!hash) return std::nullopt;
  parsed.hash = *hash;
  return parsed;
}

std::string head_line(std::uint64_t number, const Sha256& hash) {
  return fmt::format("{}{} {}\n", kHead, number, to_hex(hash));
}

bool fits(const Line& line, const Sha256& before, std::uint64_t number_before) {
  return line.number == number_before + 1 && line.hash == hash_after(before, line.number, line.text);
}

/// Whether the text is as this program writes it. The torn end of a write has other bytes, or no end of a line.
bool well_formed(std::string_view text) {
  std::string without_tabs(text);
  std::erase(without_tabs, '\t');
  return is_printable(without_tabs);
}

struct PlacedLine {
  std::size_t begin = 0, end = 0;
  Line line;
};

/// The first whole line from `at` on.
std::optional<PlacedLine> next_line(std::string_view whole, std::size_t at) {
  while (at < whole.size()) {
    const std::size_t end = whole.find('\n', at);
    if (end == std::string_view::npos) break;
    const auto line = parse_line(whole.substr(at, end - at));
    if (line && well_formed(line->text)) return PlacedLine{at, end + 1, *line};
    at = end + 1;
  }
  return std::nullopt;
}

}  // namespace

AuditStore::AuditStore(hal::DiskPort& disk) : disk_(disk), writes_(kMaxUnwritten), answers_(kMaxUnwritten) {}

bool AuditStore::step(Instant now) {
  if (!read_) {
    read_ = true;
    read();
    return true;
  }
  if (answers_.full() || (failed_ && now < retry_at_)) return false;
  std::optional<AuditRecord> record = failed_ ? std::exchange(failed_, std::nullopt) : writes_.pop();
  if (!record) return false;
  const Sha256 hash = hash_after(head_, record->number, record->text);
  const std::string line = fmt::format("{} {} {}\n", to_hex(hash), record->number, record->text);
  const std::uint64_t number = record->number;
  Status written = write(line, head_);
  if (written) {
    head_ = hash;
    newest_ = number;
  } else {
    written = fail(written.error().in("audit log"));
    failed_ = std::move(record);
    retry_at_ = now + kRetryEvery;
  }
  const bool pushed = answers_.push({number, head_, std::move(written)});
  NODAL_ASSERT(pushed);
  return true;
}

Status AuditStore::write(const std::string& line, const Sha256& before) {
  if (bytes_ == 0 || bytes_ + line.size() > kMaxFileBytes) return rotate(head_line(newest_, before) + line);
  NODAL_TRY_ASSIGN(const auto file, disk_.open_append(kAuditFile));
  // A write that failed may have left a part of its line.
  Status done;
  if (const auto size = disk_.size(kAuditFile); !size) done = fail(size.error());
  else if (*size < bytes_) done = fail(Errc::kIo, "the file became shorter while nodald ran");
  else if (*size > bytes_) done = disk_.truncate(file, bytes_);
  if (done) done = disk_.write(file, bytes_of(line));
  if (done) done = disk_.sync(file);
  disk_.close(file);
  if (done) bytes_ += line.size();
  return done;
}

/// Begins a new file. The old one must be durable under its new name before the new one takes its place.
Status AuditStore::rotate(const std::string& line) {
  if (!moved_ && disk_.size(kAuditFile)) {
    NODAL_TRY(disk_.rename(kAuditFile, kAuditBeforeFile));
  }
  moved_ = true;
  bytes_ = 0;
  NODAL_TRY(disk_.sync_folder(""));
  NODAL_TRY(write_durably(disk_, "", kAuditFile, line));
  moved_ = false;
  bytes_ = line.size();
  return {};
}

void AuditStore::read() {
  AuditReport report;
  std::vector<AuditRecord> records;
  read_file(kAuditBeforeFile, false, report, records);
  read_file(kAuditFile, true, report, records);
  report.read = true;
  report.newest = newest_;
  report.records = std::make_shared<const std::vector<AuditRecord>>(std::move(records));
  snapshot_.publish(report);
}

void AuditStore::read_file(const std::string& name, bool newest, AuditReport& report,
                           std::vector<AuditRecord>& records) {
  const auto found = [&](const std::string& what) { report.findings.push_back("the audit log: " + what); };
  const auto bytes = disk_.read(name, 2 * kMaxFileBytes);
  if (!bytes && bytes.error().code == Errc::kNotFound) return;
  if (!bytes) return found(bytes.error().message + "; its records are not shown");
  const std::string_view whole(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  const auto head = parse_head(whole.substr(0, whole.find('\n')));
  if (!head) return found(name + " does not begin as an audit log does; its records are not shown");
  const bool continues = head->hash == head_ && head->number == newest_;
  const bool removed = newest_ == 0 && name == kAuditFile && head->number > 0;  // by a rotation before the oldest file
  if (!continues && (newest_ != 0 || removed)) {
    found(fmt::format("the chain is broken between records {} and {}: a file was changed or removed", newest_,
                      head->number + 1));
  }
  head_ = head->hash;
  newest_ = head->number;
  std::size_t at = whole.find('\n') + 1;
  for (auto next = next_line(whole, at); next; next = next_line(whole, at)) {
    if (next->begin != at || !fits(next->line, head_, newest_)) {
      found(fmt::format("the chain is broken after record {}: lines of {} were changed, damaged or removed", newest_,
                        name));
    }
    head_ = next->line.hash;
    newest_ = next->line.number;
    records.push_back({newest_, std::string(next->line.text)});
    at = next->end;
  }
  if (at < whole.size()) {
    found(fmt::format("{} bytes at the end of {} are an incomplete record, as a power cut leaves it; they are cut off",
                      whole.size() - at, name));
  }
  if (newest) bytes_ = at;
}

}  // namespace nodal::firmware
