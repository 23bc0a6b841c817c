// Every text of every message that a rig can send is printable after check_and_clean(). The messages are made from
// nodal.proto itself, so a field that is added there is in this test, too.
#include "host_tool/rig/rig_input.h"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <set>

#include "protocol/base/text.h"

namespace nodal::host {
namespace {

struct Field {
  std::string type;
  std::string name;
  std::uint32_t number = 0;
};
using Schema = std::map<std::string, std::vector<Field>>;

/// The messages of nodal.proto, with the fields of their oneofs.
Schema read_schema() {
  std::ifstream file(NODAL_SOURCE_DIR "/protocol/nodal.proto");
  Schema schema;
  std::string message;
  const std::regex begins(R"(message (\w+) \{)");
  const std::regex field(R"((?:repeated |optional )?(\w+) (\w+) = (\d+))");
  for (std::string line; std::getline(file, line);) {
    line = line.substr(0, line.find("//"));
    std::smatch found;
    if (std::regex_search(line, found, begins)) message = found[1];
    for (std::sregex_iterator it(line.begin(), line.end(), field), end; it != end; ++it) {
      schema[message].push_back({(*it)[1], (*it)[2], static_cast<std::uint32_t>(std::stoul((*it)[3]))});
    }
  }
  return schema;
}

const std::string kForged = "good\n  forged line\x1b[2J\xe2\x80\xae\xc2\x9b";

void put_number(std::string& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  out += static_cast<char>(value);
}
void put_bytes(std::string& out, std::uint32_t number, const std::string& bytes) {
  put_number(out, std::uint64_t{number} << 3 | 2);
  put_number(out, bytes.size());
  out += bytes;
}

/// `name` with every text forged; of the messages in it only `choice`.
std::string forged(const Schema& schema, const std::string& name, const std::string& choice = "", int depth = 0) {
  std::string out;
  for (const Field& field : schema.at(name)) {
    if (!choice.empty() && schema.contains(field.type) && field.name != choice) continue;
    if (field.type == "string") put_bytes(out, field.number, kForged);
    if (schema.contains(field.type) && depth < 6) {
      put_bytes(out, field.number, forged(schema, field.type, "", depth + 1));
    }
  }
  return out;
}

std::uint64_t take_number(std::string_view& in) {
  std::uint64_t value = 0;
  for (int shift = 0; !in.empty(); shift += 7) {
    const auto byte = static_cast<unsigned char>(in.front());
    in.remove_prefix(1);
    value |= std::uint64_t{byte & 0x7FU} << shift;
    if (byte < 0x80) break;
  }
  return value;
}

/// Adds the fields with a text that is not printable, as "Genlock.state", and counts all texts.
void find_raw(const Schema& schema, const std::string& name, std::string_view in, std::set<std::string>& raw,
              int& texts) {
  while (!in.empty()) {
    const std::uint64_t key = take_number(in);
    if ((key & 7) == 0) {
      take_number(in);
      continue;
    }
    if ((key & 7) != 2) {
      in.remove_prefix(std::min<std::size_t>(in.size(), (key & 7) == 1 ? 8 : 4));
      continue;
    }
    const std::size_t size = std::min<std::size_t>(take_number(in), in.size());
    const std::string_view bytes = in.substr(0, size);
    in.remove_prefix(size);
    for (const Field& field : schema.at(name)) {
      if (field.number != key >> 3) continue;
      if (schema.contains(field.type)) find_raw(schema, field.type, bytes, raw, texts);
      if (field.type != "string") continue;
      ++texts;
      if (!is_printable(bytes)) raw.insert(name + "." + field.name);
    }
  }
}

template <class Message>
void expect_clean(const Schema& schema, const std::string& name, const std::string& choice = "") {
  Message message;
  ASSERT_TRUE(message.ParseFromString(forged(schema, name, choice))) << name << " " << choice;
  (void)check_and_clean(message);
  std::set<std::string> raw;
  int texts = 0;
  find_raw(schema, name, message.SerializeAsString(), raw, texts);
  raw.erase("Devices.json");  // a document: the command cleans its texts after parsing
  EXPECT_TRUE(raw.empty()) << name << " " << choice << ": " << *raw.begin();
}

TEST(RigInput, EveryTextOfEveryMessageOfARig_IsPrintable) {
  const Schema schema = read_schema();
  ASSERT_GT(schema.size(), 50U);
  int replies = 0;
  for (const Field& field : schema.at("Reply")) {
    if (!schema.contains(field.type)) continue;
    expect_clean<wire::Reply>(schema, "Reply", field.name);
    ++replies;
  }
  EXPECT_GT(replies, 12);
  expect_clean<wire::Hello>(schema, "Hello");
  expect_clean<wire::RaymapHeader>(schema, "RaymapHeader");
  expect_clean<wire::FrameSetHeader>(schema, "FrameSetHeader");
}

TEST(RigInput, TheTestItself_FindsATextThatIsNotClean) {
  const Schema schema = read_schema();
  std::set<std::string> raw;
  int texts = 0;
  find_raw(schema, "Reply", forged(schema, "Reply", "genlock"), raw, texts);
  EXPECT_TRUE(raw.contains("Genlock.state"));
  EXPECT_TRUE(raw.contains("PulseCount.reason"));
  EXPECT_TRUE(raw.contains("Reply.not_stored"));
  EXPECT_GE(texts, 4);
}

}  // namespace
}  // namespace nodal::host
