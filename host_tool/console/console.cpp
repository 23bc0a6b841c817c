#include "host_tool/console/console.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "protocol/base/fit_text.h"
#include "protocol/base/text.h"

namespace nodal::host {
namespace {

constexpr std::string_view kReset = "\x1b[0m";

std::string_view escape(Colour colour) {
  switch (colour) {
    case Colour::kGood: return "\x1b[32m";
    case Colour::kWarning: return "\x1b[33m";
    case Colour::kBad: return "\x1b[31m";
    case Colour::kDim: return "\x1b[2m";
    case Colour::kStrong: return "\x1b[1m";
  }
  return "";
}

bool is_terminal(std::FILE* file) { return file != nullptr && isatty(fileno(file)) == 1; }

bool colour_wanted() {
  const char* no_color = std::getenv("NO_COLOR");  // https://no-color.org: set and not empty
  const char* term = std::getenv("TERM");
  return (no_color == nullptr || *no_color == '\0') && (term == nullptr || std::strcmp(term, "dumb") != 0);
}

void put(std::FILE* file, std::string_view text) { std::fwrite(text.data(), 1, text.size(), file); }

/// Prepares a line for a terminal: keeps the colours of paint(), replaces all other control characters and ends of
/// lines, because names and errors come from rigs and files, which must not forge a line.
std::string shown(std::string_view text) {
  constexpr std::array<std::string_view, 6> kKept{kReset, "\x1b[32m", "\x1b[33m", "\x1b[31m", "\x1b[2m", "\x1b[1m"};
  std::string result;
  while (!text.empty()) {
    const std::size_t plain = std::min(text.find('\x1b'), text.size());
    result += printable(text.substr(0, plain), std::string::npos);
    text.remove_prefix(plain);
    if (text.empty()) break;
    const auto kept = std::ranges::find_if(kKept, [&](std::string_view code) { return text.starts_with(code); });
    result += kept == kKept.end() ? std::string_view("?") : *kept;
    text.remove_prefix(kept == kKept.end() ? 1 : kept->size());
  }
  return result;
}

/// Serializes JSON. Names from a rig may be any bytes: invalid UTF-8 is replaced, and does not throw.
std::string line_of(const Json& document) {
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::size_t columns_of(std::FILE* file) {
  constexpr unsigned short kNarrowest = 20;  // a terminal that states less is not taken at its word
  winsize size{};
  const bool stated = file != nullptr && ::ioctl(fileno(file), TIOCGWINSZ, &size) == 0 && size.ws_col >= kNarrowest;
  return stated ? size.ws_col : kLineWidth;
}

/// 0: it does not say.
std::size_t rows_of(std::FILE* file) {
  winsize size{};
  return file != nullptr && ::ioctl(fileno(file), TIOCGWINSZ, &size) == 0 ? size.ws_row : 0;
}

/// The first `columns` visible characters.
std::string cut_to(const std::string& text, std::size_t columns) {
  std::string result = text;
  while (width_of(result) > columns) result.pop_back();
  return result;
}

std::int64_t now_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

/// ", 2 min left", as the time that was needed until now says; empty while that says little.
std::string time_left(double seconds, double part) {
  constexpr double kMinSeconds = 3, kMinPart = 0.05;
  if (seconds < kMinSeconds || part < kMinPart || part >= 1) return "";
  const double left = seconds * (1 - part) / part;
  if (left < 90) return fmt::format(", {:.0f} s left", std::ceil(left));
  if (left < 5400) return fmt::format(", {:.0f} min left", std::ceil(left / 60));
  return fmt::format(", {:.0f} h left", std::ceil(left / 3600));
}

}  // namespace

Console::Console(std::FILE* out, std::FILE* err)
    : out_(out),
      err_(err),
      out_terminal_(is_terminal(out)),
      err_terminal_(is_terminal(err)),
      colour_(colour_wanted()) {}

void Console::bytes(std::string_view data) {
  if (output_error_ != 0) return;
  const bool written = data.empty() || std::fwrite(data.data(), 1, data.size(), out_) == data.size();
  if (!written || std::fflush(out_) != 0) output_error_ = errno;
}

int Console::end_output() {
  bytes({});
  // Some file systems, such as NFS, report a full disk only at close. Closing a duplicate is sufficient.
  const int duplicate = output_error_ != 0 ? -1 : ::dup(fileno(out_));
  if (duplicate >= 0 && ::close(duplicate) != 0) output_error_ = errno;
  return output_error_;
}

void Console::line(std::string_view text) {
  if (json_) return;
  finish_progress();
  const std::string fit = (out_terminal_ ? fitted(shown(text), columns_of(out_)) : shown(text)) + "\n";
  const auto lines = static_cast<std::size_t>(std::ranges::count(fit, '\n'));
  if (room_ && (cut_ > 0 || lines > *room_)) {
    cut_ += lines;
    return;
  }
  if (room_) *room_ -= lines;
  bytes(fit);
}

void Console::help(const std::string& text) { bytes(out_terminal_ ? fitted(text, columns_of(out_)) : text); }

void Console::document(const Json& document) {
  if (json_) bytes(line_of(document));
}

void Console::note(std::string_view text) {
  finish_progress();
  put(err_, (err_terminal_ ? fitted(shown(text), columns_of(err_)) : shown(text)) + "\n");
}

void Console::warning(std::string_view text) {
  note(paint_for(err_terminal_, Colour::kWarning, "warning: ") + std::string(text));
}

void Console::error(const Error& error) {
  finish_progress();
  put(err_, error_text(error));
  if (json_) bytes(error_document(error));
}

std::string Console::error_text(const Error& error) const {
  const std::string text = paint_for(err_terminal_, Colour::kBad, "nodal: ") + shown(error.text());
  return (err_terminal_ ? fitted(text, columns_of(err_)) : text) + "\n";
}

std::string Console::error_document(const Error& error) const {
  return line_of(
      {{"error",
        {{"code", static_cast<int>(error.code)}, {"name", errc_name(error.code)}, {"message", error.message}}}});
}

std::string Console::paint_for(bool terminal, Colour colour, std::string_view text) const {
  if (!terminal || !colour_) return std::string(text);
  return fmt::format("{}{}{}", escape(colour), text, kReset);
}

std::string Console::paint(Colour colour, std::string_view text) const {
  return paint_for(out_terminal_ && !json_, colour, text);
}

bool Console::confirmed(std::string_view question) {
  if (json_ || !err_terminal_ || ::isatty(STDIN_FILENO) != 1) return true;
  finish_progress();
  put(err_, shown(question) + " [y/N] ");
  std::fflush(err_);
  std::array<char, 16> answer{};
  if (std::fgets(answer.data(), answer.size(), stdin) == nullptr) return false;
  return answer[0] == 'y' || answer[0] == 'Y';
}

void Console::home() {
  if (!out_terminal_ || json_) return;
  bytes("\x1b[H\x1b[J");
  constexpr std::size_t kFoot = 2;  // the foot's line and the cursor's
  if (const std::size_t rows = rows_of(out_); rows > kFoot) room_ = rows - kFoot;
  cut_ = 0;
}

void Console::foot(std::string_view text) {
  room_.reset();
  line(paint(Colour::kDim, cut_ == 0 ? fmt::format("  {}", text)
                                     : fmt::format("  {}; {} more lines in a higher window", text, cut_)));
  cut_ = 0;
}

void Console::progress(std::string_view text) {
  if (err_terminal_) {
    // A line that the terminal wraps could not be overwritten.
    put(err_, fmt::format("\r{}\x1b[K", cut_to(shown(text), columns_of(err_) - 1)));
    progress_shown_ = true;
  } else {
    put(err_, shown(text) + "\n");
  }
  std::fflush(err_);
}

void Console::activity(const std::string& text) {
  if (text.empty() || text == activity_) return;
  activity_ = text;
  progress(text);
}

void Console::finish_progress() {
  if (progress_shown_) put(err_, "\r\x1b[K");
  progress_shown_ = false;
}

void Table::row(std::vector<std::string> cells) {
  NODAL_ASSERT(cells.size() == columns_.size());
  rows_.push_back(std::move(cells));
}

std::vector<std::string> Table::lines() const {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t width = width_of(columns_[c].title);
    for (const auto& row : rows_) width = std::max(width, width_of(row[c]));
    widths.push_back(width);
  }
  const auto lay_out = [&](auto cell_of) {
    std::string line;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const std::string& cell = cell_of(c);
      const std::string room(widths[c] - width_of(cell), ' ');
      line += columns_[c].align == Align::kRight ? room + cell : cell + room;
      if (c + 1 < columns_.size()) line += "  ";
    }
    line.erase(line.find_last_not_of(' ') + 1);
    return line;
  };
  std::vector<std::string> lines;
  lines.push_back(lay_out([&](std::size_t c) -> const std::string& { return columns_[c].title; }));
  for (const auto& row : rows_) lines.push_back(lay_out([&](std::size_t c) -> const std::string& { return row[c]; }));
  return lines;
}

Progress::Progress(Console& console, std::string what, std::uint64_t total)
    : console_(console), what_(std::move(what)), total_(total), begun_ns_(now_ns()), last_ns_(begun_ns_) {}

Progress::~Progress() { console_.finish_progress(); }

void Progress::update(std::uint64_t done, std::string_view remark) {
  const std::int64_t now = now_ns();
  const std::int64_t every = console_.err_is_terminal() ? 100'000'000 : 2'000'000'000;
  if (now - last_ns_ < every) return;
  last_ns_ = now;
  if (total_ == 0) {
    console_.progress(fmt::format("{} {}  {}", what_, done, remark));
    return;
  }
  constexpr int kBar = 24;
  const double part = std::min(1.0, static_cast<double>(done) / static_cast<double>(total_));
  const auto filled = static_cast<std::size_t>(part * kBar);
  const std::string bar = std::string(filled, '#') + std::string(kBar - filled, '.');
  console_.progress(fmt::format("{} [{}] {:.0f} %{}  {}", what_, bar, std::floor(100 * part),
                                time_left(static_cast<double>(now - begun_ns_) / 1e9, part), remark));
}

}  // namespace nodal::host
