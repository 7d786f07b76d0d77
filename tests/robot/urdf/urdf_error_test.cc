#include <algorithm>
#include <catch2/catch.hpp>

#include "common/config.h"
#include "robot/description.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;

int LineOf(const std::string& text, const std::string& what) {
  const size_t at = text.find(what);
  REQUIRE(at != std::string::npos);
  return 1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<long>(at), '\n'));
}

std::string Error(const std::string& urdf, const std::string& toml = kZooToml) {
  const RobotFolder folder(urdf, toml);
  try {
    LoadRobot(folder.path());
  } catch (const ConfigError& error) {
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
  return "no error";
}

// The zoo with one text replaced: the error is at that line, or at that of `blamed`.
void Check(const std::string& from, const std::string& to, const std::string& what,
           const std::string& blamed = "") {
  INFO(from << " -> " << to);
  const std::string urdf = Replaced(kZooUrdf, from, to);
  const int line = blamed.empty() ? LineOf(kZooUrdf, from) : LineOf(urdf, blamed);
  CHECK_THAT(Error(urdf), Contains("robot.urdf:" + std::to_string(line) + ": ") && Contains(what));
}

TEST_CASE("the zoo itself is in order") { CHECK(Error(kZooUrdf) == "no error"); }

TEST_CASE("broken XML is an error with its row") {
  Check("<axis xyz=\"0 0 3\"/>", "<axis xyz=\"0 0 3\">", "end tag", "</joint>");
  Check("<axis xyz=\"0 0 3\"/>", "<axis xyz=\"0 0 3/>", "Attributes",
        "<dynamics damping=\"0.5\"");  // TinyXML's row
  Check("<axis xyz=\"0 0 3\"/>", "<axis xyz=0 0 3/>", "");
  Check("<axis xyz=\"0 0 3\"/>", "<axis \x01/>", "contains the byte 0x01");
  for (const char* not_utf8 : {"<axis \xe1/>", "<axis \xc3\"/>", "<axis \xff/>"})
    Check("<axis xyz=\"0 0 3\"/>", not_utf8, "a URDF is text in UTF-8");
  CHECK_THAT(Error(kZooUrdf + "\n\xe1"), Contains("contains the byte 0xe1"));
  CHECK_THAT(Error(Replaced(kZooUrdf, "</robot>\n", "")),
             Contains("robot.urdf:" + std::to_string(LineOf(kZooUrdf, "</robot>"))));
}

TEST_CASE("every number is one, finite and within reason") {
  for (const char* number : {"", "nan", "inf", "-inf", "1e308", "1e999", "x", "1,5", "2 3", "0x10",
                             "1e", "--1", "+-1"}) {
    Check("mass value=\"2\"", std::string("mass value=\"") + number + "\"", "");
    Check("effort=\"20\"", std::string("effort=\"") + number + "\"", "");
    Check("upper=\"1.5\"", std::string("upper=\"") + number + "\"", "");
    Check("radius=\"0.04\"", std::string("radius=\"") + number + "\"", "");
    Check("xyz=\"0 0 -0.4\"", std::string("xyz=\"0 0 ") + number + "\"", "");
    Check("friction=\"0.2\"", std::string("friction=\"") + number + "\"", "");
  }
  CHECK(Error(Replaced(kZooUrdf, "xyz=\"0 0 -0.4\"", "xyz=\" +0\t0\n -.4e0 \"")) == "no error");
}

TEST_CASE("every mistake is at its line") {
  Check("<robot name=\"zoo\">", "<robot>", "<robot> has no name");
  Check("mass value=\"2\"", "mass value=\"-2\"", "link carriage: mass must not be negative");
  Check("<mass value=\"2\"/>", "", "<inertial> has no <mass>", "<inertial>");
  Check("ixx=\"1e-4\"", "ixx=\"-1\"", "link foot: no body can have this inertia",
        "<inertial>\n      <mass value=\"0.1\"/>");
  Check("mass value=\"0.1\"", "mass value=\"0\"", "inertia without mass",
        "<inertial>\n      <mass value=\"0\"/>");
  Check("izz=\"1e-4\"", "", "<inertia> has no izz");
  Check("<link name=\"slider\"/>", "<link name=\"ball\"/>", "a second link is called ball",
        "<link name=\"ball\">\n");
  Check("<link name=\"slider\"/>", "<link name=\"s\xc3\xbclider\"/>", "not printable ASCII");
  Check("<link name=\"slider\"/>", "<link name=\"s\xfclider\"/>", "a URDF is text in UTF-8");
  Check("<link name=\"slider\"/>", "<link/>", "<link> has no name");
  Check("<link name=\"slider\"/>", "<link name=\"slider\"/><link name=\"lost\"/>",
        "link lost hangs on no joint");
  Check("<capsule ", "<cone ", "<cone> is not one of box, sphere, cylinder, capsule, mesh");
  Check("<sphere radius=\"0.03\"/>", "", "<geometry> is empty");
  Check("<sphere radius=\"0.03\"/>", "<sphere radius=\"1\"/><sphere radius=\"1\"/>",
        "a second solid");
  Check("size=\"0.3 0.2 0.1\"", "size=\"0.3 0 0.1\"", "size of <box> must be positive");
  Check("radius=\"0.05\" length=\"0.2\"", "radius=\"0.05\"", "<cylinder> has no length");
  Check("type=\"revolute\"", "type=\"ball\"", "joint hip is not fixed");
  Check("type=\"revolute\"", "", "<joint> has no type");
  Check("<parent link=\"thigh\"/>", "<parent link=\"shank\"/>",
        "joint spring: there is no link shank", "<joint name=\"spring\"");
  Check("<child link=\"thigh\"/>", "", "<joint> has no <child>", "<joint name=\"hip\"");
  Check("<child link=\"rotor\"/>", "<child link=\"foot\"/>",
        "link foot is moved by joint weld and by joint disc", "<joint name=\"disc\"");
  Check("<joint name=\"spring\"", "<joint name=\"hip\"", "a second joint is called hip",
        "<joint name=\"hip\" type=\"prismatic\"");
  Check("<limit lower=\"-0.1\" upper=\"0.1\"/>", "", "joint spring has no <limit>",
        "<joint name=\"spring\"");
  Check("lower=\"-0.1\"", "lower=\"0.1\"", "joint spring: limit lower must be below upper");
  Check("effort=\"20\"", "effort=\"-20\"", "joint hip: limit effort must not be negative");
  Check("effort=\"20\"", "effort=\"0\"",
        "joint hip: limit effort must be positive: it has a motor");
  Check("effort=\"20\"", "", "joint hip: limit effort must be positive: it has a motor");
  Check("velocity=\"10\"", "velocity=\"0\"", "joint hip: limit velocity must be positive");
  Check("velocity=\"10\"", "", "joint hip: limit velocity is missing: it has a motor");
  Check("<limit effort=\"3\" velocity=\"30\"/>", "", "joint disc: limit effort",
        "<joint name=\"disc\"");
  Check("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", "joint hip has no axis");
  Check("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 0\"/><axis xyz=\"0 1 0\"/>",
        "a second <axis> in <joint>");
  Check("damping=\"0.1\"", "damping=\"-0.1\"", "joint hip: damping must not be negative");
  Check("<axis xyz=\"0 1 0\"/>", "<mimic joint=\"spring\"/>", "joint hip is to mimic another");
  Check("<link name=\"slider\"/>",
        "<link name=\"slider\"/><link name=\"free/x\"/><joint name=\"w\" type=\"fixed\">"
        "<parent link=\"base\"/><child link=\"free/x\"/></joint>",
        "link free/x is a part of joint free");
}

TEST_CASE("links that no way leads to are not dropped") {
  const std::string ring = R"(<link name="p"/><link name="q"/>
    <joint name="pq" type="continuous"><parent link="p"/><child link="q"/></joint>
    <joint name="qp" type="continuous"><parent link="q"/><child link="p"/></joint></robot>)";
  const std::string urdf = Replaced(kZooUrdf, "</robot>", ring);
  CHECK_THAT(Error(urdf), Contains(":" + std::to_string(LineOf(urdf, "<link name=\"p\"/>")) +
                                   ": link p is part of a cycle"));
  // All in one cycle: there is no root.
  CHECK_THAT(Error("<robot name='r'>" + ring), Contains("robot.urdf:1: link p is part of a cycle"));
  CHECK_THAT(Error("<robot name='r'>\n</robot>"), Contains("robot.urdf:1: has no <link>"));
  CHECK_THAT(Error(""), Contains("robot.urdf:1: "));
  CHECK_THAT(Error("<model/>"), Contains("robot.urdf:1: <model> is not a <robot>"));
}

TEST_CASE("what moves has mass, carries some, or has a rotor's inertia") {
  CHECK_THAT(Error(kZooUrdf, Replaced(kZooToml, "armature = 0.002", "")),
             Contains("robot.urdf:" + std::to_string(LineOf(kZooUrdf, "<link name=\"rotor\"/>")) +
                      ": link rotor moves"));
  Check("<child link=\"foot\"/>", "<child link=\"base2\"/>", "there is no link base2",
        "<joint name=\"weld\"");
  std::string light = Replaced(kZooUrdf, "<mass value=\"0.1\"/>", "<mass value=\"0\"/>");
  light = Replaced(light, "ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"",
                   "ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"");
  CHECK_THAT(Error(light), Contains("link slider moves but has no mass"));
}

TEST_CASE("absurd sizes are refused") {
  std::string chain, deep;
  for (int i = 0; i < 5000; ++i) {
    const std::string a = std::to_string(i), b = std::to_string(i + 1);
    chain += "<link name='l" + a + "'/><joint name='j" + a + "' type='continuous'><parent link='l" +
             a + "'/><child link='l" + b + "'/></joint>\n";
  }
  CHECK_THAT(Error("<robot name='r'>" + chain + "<link name='l5000'/></robot>"),
             Contains("robot.urdf:1001: more than 1000 links"));
  for (int i = 0; i < 200; ++i) {
    const std::string a = std::to_string(i), b = std::to_string(i + 1);
    deep += "<link name='l" + a + "'/><joint name='j" + a + "' type='floating'><parent link='l" +
            a + "'/><child link='l" + b + "'/></joint>\n";
  }
  CHECK_THAT(Error("<robot name='r'>" + deep + "<link name='l200'/></robot>"),
             Contains("robot.urdf:126: more than 500 moving joints"));
  std::string nested;
  for (int i = 0; i < 200000; ++i) nested += "<a>\n";
  CHECK_THAT(Error(nested), Contains("robot.urdf:101: nests more than 100 elements"));
  // Ends of elements that have not begun, and what is no element, take nothing off the depth.
  std::string ends, hundred;
  for (int i = 0; i < 200000; ++i) ends += "</a>";
  for (int i = 0; i < 100; ++i) hundred += "<a>";
  for (const std::string& before :
       {ends, "<!x " + ends + ">", "<robot name='r'><!-->" + ends + "-->", "<?x " + ends + "?>",
        hundred + "<!-->" + ends + "-->", hundred + "<1" + ends, hundred + "<!x '" + ends + "'>",
        hundred + "<a b='" + ends + "'/>", hundred + "<![CDATA[" + ends + "]]>"}) {
    CAPTURE(before.substr(0, 30));
    CHECK_THAT(Error(before + nested), Contains("nests more than 100 elements"));
  }
  CHECK_THAT(Error(hundred + "<?xml version='" + ends + "'?>" + nested),
             Contains("robot.urdf:1: a declaration within an element"));
  std::string attributes;
  for (int i = 0; i < 500'000; ++i) attributes += " a" + std::to_string(i) + "='<'";
  CHECK_THAT(Error("<robot name='r'>\n<link" + attributes + "/></robot>"),
             Contains("robot.urdf:2: an element of more than 100 attributes"));
  CHECK_THAT(Error("<robot name='r'>" + std::string(17 << 20, ' ')),
             Contains("robot.urdf: is longer than 16 MB"));
  CHECK_THAT(Error(Replaced(kZooUrdf, "name=\"hip\"", "name=\"" + std::string(1000, 'h') + "\"")),
             Contains("longer than 200 bytes"));
}

}  // namespace
}  // namespace plumb
