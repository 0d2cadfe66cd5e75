# Tests of the member list with v3dctl: the authority's key, an operator's key, enrolment, revocation. Run by cmake -P with
# V3DCTL and WORK.
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})

# v3dctl ARGS...: sets status, out, err.
macro(v3dctl)
  execute_process(COMMAND ${V3DCTL} --studio ${WORK}/studio.toml ${ARGN} WORKING_DIRECTORY ${WORK}
    RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
endmacro()
function(expect wanted pattern)
  if(NOT status EQUAL wanted OR NOT "${out}${err}" MATCHES "${pattern}")
    message(SEND_ERROR "expected status ${wanted} and ${pattern}, got status ${status}: ${out}${err}")
  endif()
endfunction()
# Sets `key` to the public key in the output.
macro(take_public_key)
  string(REGEX MATCH "[0-9a-f]+[^0-9a-f]*$" key "${out}")
  string(REGEX MATCH "[0-9a-f]+" key "${key}")
  string(LENGTH "${key}" digits)
  if(NOT digits EQUAL 64)
    message(SEND_ERROR "no public key in: ${out}${err}")
  endif()
endmacro()
function(write_studio authority)
  file(WRITE ${WORK}/studio.toml "name = 'kyoto'
[[node]]
name = 'cap01'
[[node]]
name = 'recon01'
[camera_defaults]
node = 'cap01'
[[camera]]
name = 'cam01'
address = 'V3D-SIM-01'
[[camera]]
name = 'cam02'
address = 'V3D-SIM-02'
[trigger]
node = 'cap01'
kind = 'simulated'
rate_hz = 25
wire = 'trigger.sock'
[space]
min = [-1, -1, 0]
max = [1, 1, 2]
[network]
members = 'members.toml'
authority = '${authority}'
operator_key = 'operator.key'
[storage]
takes = 'takes'
background = 'background'
calib = 'calib.toml'
signing_key = 'node.key'
[reconstruction]
node = 'recon01'
min_views = 2
")
endfunction()

v3dctl(key authority)
expect(0 "do not store it on a PC of the studio")
take_public_key()
write_studio(${key})
v3dctl(key authority)
expect(2 "cannot make the authority key")

v3dctl(key node)
expect(0 "made ")
take_public_key()
set(node_key ${key})
v3dctl(key operator)
expect(0 "v3dctl key enroll NAME --role operator --public-key ")
take_public_key()
set(ada_key ${key})

v3dctl(key members)
expect(2 "members.toml")
v3dctl(key enroll cap01 --role capture --public-key ${node_key})
expect(0 "serial number 1: copy it to every PC")
v3dctl(key enroll ada --role operator --public-key ${ada_key})
expect(0 "serial number 2")
v3dctl(key enroll ada --role operator --public-key ${ada_key})
expect(2 "an earlier entry gives this member the same key")
v3dctl(key enroll ada --role viewer --public-key ${node_key})
expect(2 "an earlier entry gives this member another role")
v3dctl(key enroll bob --role operator --public-key 12)
expect(2 "--public-key: expected a public key of 64 hexadecimal digits")
v3dctl(key members)
expect(0 "serial number 2\ncapture +cap01 +${node_key}\noperator +ada +${ada_key}")
v3dctl(key members --json)
expect(0 "\"name\": \"ada\"")

v3dctl(key revoke bob)
expect(2 "no member bob")
v3dctl(key revoke ada --public-key ${node_key})
expect(2 "no member ada with such a key")
v3dctl(key revoke ada)
expect(0 "serial number 3")
v3dctl(key members)
expect(0 "serial number 3\ncapture +cap01 +[0-9a-f]+\n$")

# A list signed by another key is rejected, and a changed list is reported.
v3dctl(key authority --authority other.key)
expect(0 "made other.key")
v3dctl(key enroll eve --role operator --public-key ${node_key} --authority other.key)
expect(2 "other.key: its public key is [0-9a-f]+, but .*studio.toml has a different key")
file(READ ${WORK}/members.toml list)
string(REPLACE "capture" "operator" list "${list}")
file(WRITE ${WORK}/members.toml "${list}")
v3dctl(key members)
expect(2 "not signed by \\[network\\] authority")
v3dctl(key enroll eve --role operator --public-key ${node_key})
expect(2 "not signed by \\[network\\] authority")
