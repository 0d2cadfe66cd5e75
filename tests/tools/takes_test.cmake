# Tests that takes are collected from two nodes, marked, listed and deleted. Run by cmake -P with V3DCTL, V3D_SIM and WORK.
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK}/cap01 ${WORK}/cap02)

include(${CMAKE_CURRENT_LIST_DIR}/v3dctl_result.cmake)

# One simulated take, as two nodes with two cameras each would have recorded it.
execute_process(COMMAND ${V3D_SIM} take ${WORK}/whole/kendo-07 --frames 4 --cameras 4 --size 320x240
  RESULT_VARIABLE status ERROR_VARIABLE err)
expect_status(0)
file(READ ${WORK}/whole/kendo-07/take.toml info)
file(READ ${WORK}/whole/kendo-07/ledger.toml ledger)
# The parts below have no checksum of their own, as ledgers of earlier versions.
string(REGEX REPLACE "^xxh3 = '[0-9a-f]+'\n" "" ledger "${ledger}")
string(FIND "${ledger}" "[[camera]]\nname = 'cam03'" second)
string(FIND "${ledger}" "[[camera]]" first)
string(SUBSTRING "${ledger}" 0 ${first} head)
string(SUBSTRING "${ledger}" ${second} -1 tail)
string(SUBSTRING "${ledger}" 0 ${second} ledger_cap01)
string(FIND "${ledger}" "[[file]]" files)
string(SUBSTRING "${ledger}" ${files} -1 files)
set(ledger_cap01 "${ledger_cap01}${files}")
set(ledger_cap02 "${head}${tail}")
# Remove what a node does not have; its take.toml differs.
set(entry "\\[\\[file\\]\\]\nname = 'NAME'\nbytes = [0-9]+\nxxh3 = '[0-9a-f]+'\n+")
foreach(absent cap01:take.toml cap01:cam03.lcmlog cap01:cam04.lcmlog cap02:take.toml cap02:cam01.lcmlog cap02:cam02.lcmlog)
  string(REGEX REPLACE "(.*):(.*)" "\\1;\\2" words ${absent})
  list(GET words 0 node)
  list(GET words 1 name)
  string(REPLACE NAME ${name} pattern "${entry}")
  string(REGEX REPLACE "${pattern}" "" ledger_${node} "${ledger_${node}}")
endforeach()
foreach(node cap01 cap02)
  file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/${node})
  file(WRITE ${WORK}/${node}/kendo-07/ledger.toml "${ledger_${node}}")
endforeach()
string(REGEX REPLACE "cameras = [^\n]*" "cameras = ['cam01', 'cam02']" of_cap01 "${info}")
string(REGEX REPLACE "cameras = [^\n]*" "cameras = ['cam03', 'cam04']" of_cap02 "${info}")
file(WRITE ${WORK}/cap01/kendo-07/take.toml "${of_cap01}")
file(WRITE ${WORK}/cap02/kendo-07/take.toml "${of_cap02}")
file(REMOVE ${WORK}/cap01/kendo-07/cam03.lcmlog ${WORK}/cap01/kendo-07/cam04.lcmlog
  ${WORK}/cap02/kendo-07/cam01.lcmlog ${WORK}/cap02/kendo-07/cam02.lcmlog)

set(sources --from cap01=${WORK}/cap01 --from cap02=far:${WORK}/cap02 --rsh ${WORK}/rsh)
# "ssh far COMMAND...", without a network.
file(WRITE ${WORK}/rsh "#!/bin/sh\n[ \"$1\" = far ] || exit 9\nshift\nexec \"$@\"\n")
file(CHMOD ${WORK}/rsh PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)

# Files of an earlier take of the same name are not mixed into the copy, and not removed.
foreach(left slate.toml cam01.0001.lcmlog)
  file(WRITE ${WORK}/archive/.collect/kendo-07/cap01/${left} "of an earlier take")
endforeach()
v3dctl(takes collect ${sources} --to ${WORK}/archive kendo-07)
expect_status(3)
expect("${out}" "kendo-07: not collected: [^\n]*cap01: has files that cap01 does not have, [^\n]*slate.toml[^\n]*; move ")
foreach(left slate.toml cam01.0001.lcmlog)
  if(NOT EXISTS ${WORK}/archive/.collect/kendo-07/cap01/${left} OR EXISTS ${WORK}/archive/kendo-07)
    message(SEND_ERROR "${left} of an earlier take was removed, or collected")
  endif()
endforeach()
file(REMOVE_RECURSE ${WORK}/archive/.collect)

# Nor is a part of a node that is not collected from: it may be the last copy.
set(staged ${WORK}/archive/.collect/kendo-07/cap01)
file(WRITE ${staged}/cam01.lcmlog "the last copy")
v3dctl(takes collect --from cap02=far:${WORK}/cap02 --rsh ${WORK}/rsh --to ${WORK}/archive kendo-07)
expect_status(3)
expect("${out}" "kendo-07: not collected: [^\n]*cap01: is the part of cap01 that an earlier run has copied; collect from cap01, too, or move ")

# Nor is an earlier take with files of the same names.
string(REPLACE "started_ns = 17" "started_ns = 16" earlier "${of_cap01}")
if(earlier STREQUAL of_cap01)
  message(SEND_ERROR "take.toml has no time of its start")
endif()
file(WRITE ${staged}/take.toml "${earlier}")
v3dctl(takes collect ${sources} --to ${WORK}/archive kendo-07)
expect_status(3)
expect("${out}" "kendo-07: not collected: [^\n]*cap01: is of an earlier take of this name on cap01; move ")
file(READ ${staged}/cam01.lcmlog left)
file(READ ${staged}/take.toml info_left)
if(NOT left STREQUAL "the last copy" OR NOT info_left STREQUAL earlier OR EXISTS ${WORK}/archive/kendo-07)
  message(SEND_ERROR "a part of an earlier run was removed, overwritten, or collected")
endif()
file(REMOVE_RECURSE ${WORK}/archive/.collect)

# An interrupted copy of a log is continued.
file(MAKE_DIRECTORY ${WORK}/archive/.collect/kendo-07/cap01)
execute_process(COMMAND head -c 100000 ${WORK}/cap01/kendo-07/cam01.lcmlog
  OUTPUT_FILE ${WORK}/archive/.collect/kendo-07/cap01/cam01.lcmlog)

v3dctl(takes collect --to ${WORK}/archive --from cap01=${WORK}/cap01 --from cap02=far:${WORK}/gone
  --rsh ${WORK}/rsh)
expect_status(2)
expect("${err}" "cannot list the takes of cap02 at far:")
v3dctl(takes collect ${sources} --to ${WORK}/archive nobody-01)
expect_status(2)
expect("${err}" "no node has a take nobody-01")
# A take of which a capture node has nothing is not collected, unless the node is left out on purpose.
file(COPY ${WORK}/cap01/kendo-07 DESTINATION ${WORK}/cap01/lost-01.tmp)
file(RENAME ${WORK}/cap01/lost-01.tmp/kendo-07 ${WORK}/cap01/lost-01)
file(REMOVE_RECURSE ${WORK}/cap01/lost-01.tmp)
file(WRITE ${WORK}/cap01/lost-01/studio.toml "name = 'dojo'
[[node]]
name = 'cap01'
[[node]]
name = 'cap02'
[trigger]
node = 'cap01'
wire = 'wire'
[[camera]]
name = 'cam01'
node = 'cap01'
address = '127.0.0.1'
[[camera]]
name = 'cam03'
node = 'cap02'
address = '127.0.0.1'
[space]
min = [0, 0, 0]
max = [1, 1, 1]
[reconstruction]
node = 'cap01'
[storage]
takes = 'takes'
background = 'background'
calib = 'calib.toml'
")
v3dctl(takes collect ${sources} --to ${WORK}/archive lost-01)
expect_status(3)
expect("${out}" "lost-01: not collected: cap02 has no part of it at far:.*is its disk mounted")
if(EXISTS ${WORK}/archive/lost-01)
  message(SEND_ERROR "a take without the cameras of cap02 was collected")
endif()
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive lost-01)
expect_status(3)
expect("${out}" "take [^\n]*: incomplete, 2 cameras x 4 pulses, 0 missing, 0 suspect, without cap02 \\(cam03\\)\n$")
if(NOT EXISTS ${WORK}/archive/lost-01)
  message(SEND_ERROR "cap02 could not be left out: ${out}${err}")
endif()
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive lost-01 --json)
expect_status(3)
expect("${out}" "\"was_there\": true,.*\"complete\": false,")
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive lost-01)
expect_status(3)
expect("${out}" "^take lost-01: exists already, incomplete, 2 cameras x 4 pulses[^\n]*, without cap02 \\(cam03\\)\n$")
v3dctl(verify ${WORK}/archive/lost-01)
expect_status(3)
expect("${out}" "not in this copy: cap02 \\(cam03\\)\n")
expect("${out}" "incomplete, [^\n]*, without cap02 \\(cam03\\)\n$")
v3dctl(verify ${WORK}/archive/lost-01 --json)
expect("${out}" "\"absent_nodes\": \\[[^]]*\"cam03\"[^]]*\\],[^]]*\"name\": \"cap02\"")
v3dctl(takes ${WORK}/archive)
expect("${out}" " incomplete +verified .* 0 meshes, without cap02 \\(cam03\\)\n$")
file(REMOVE_RECURSE ${WORK}/cap01/lost-01 ${WORK}/archive/lost-01)

# A copy with a byte lost between rsync and the disk is not collected; a repeated command repairs it.
file(MAKE_DIRECTORY ${WORK}/bin)
find_program(RSYNC rsync REQUIRED)
file(WRITE ${WORK}/bin/rsync "#!/bin/sh
${RSYNC} \"$@\" || exit $?
for plate in ${WORK}/archive/.collect/kendo-07/cap01/background/cam01.mean.png; do
  [ ! -e $plate ] || printf X | dd of=$plate bs=1 seek=500 conv=notrunc status=none
done
")
file(CHMOD ${WORK}/bin/rsync PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
set(path "$ENV{PATH}")
set(ENV{PATH} "${WORK}/bin:${path}")
v3dctl(takes collect ${sources} --to ${WORK}/archive)
set(ENV{PATH} "${path}")
expect_status(3)
expect("${out}" "kendo-07: not collected: the copy differs from the files of the nodes")
expect("${out}" "background/cam01.mean.png: has the checksum [0-9a-f]+, the ledger says [0-9a-f]+")
if(EXISTS ${WORK}/archive/kendo-07)
  message(SEND_ERROR "a damaged copy was collected")
endif()
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(0)
expect("${out}" "take kendo-07: complete, 4 cameras x 4 pulses, 0 missing, 0 suspect")
if(EXISTS ${WORK}/archive/.collect)
  message(SEND_ERROR "something was left in .collect")
endif()
v3dctl(verify ${WORK}/archive/kendo-07)
expect_status(0)
foreach(log cam01 cam02 cam03 cam04 pulses)
  execute_process(COMMAND cmp ${WORK}/whole/kendo-07/${log}.lcmlog ${WORK}/archive/kendo-07/${log}.lcmlog
    RESULT_VARIABLE status)
  expect_status(0)
endforeach()
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(0)
expect("${out}" "^take kendo-07: exists already, complete, 4 cameras x 4 pulses, 0 missing, 0 suspect\n$")
file(READ ${WORK}/archive/kendo-07/verified.toml verified)
string(REPLACE "agrees = true" "agrees = false" disagrees "${verified}")
file(WRITE ${WORK}/archive/kendo-07/verified.toml "${disagrees}")
file(RENAME ${WORK}/archive/kendo-07/background/cam01.mean.png ${WORK}/plate.png)
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(3)
expect("${out}" "cam01.mean.png: missing; .*take kendo-07: exists already, complete")
file(RENAME ${WORK}/plate.png ${WORK}/archive/kendo-07/background/cam01.mean.png)
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(0)
# A disagreement of the signatures is not one of the files, which collect verifies.
v3dctl(verify ${WORK}/archive/kendo-07 --signed)
expect_status(3)
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(3)
expect("${out}" "cannot check signatures without .* \\(found by v3dctl verify .*/archive/kendo-07; repeat it\\)")
v3dctl(verify ${WORK}/archive/kendo-07)
expect_status(0)
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(0)

# Slate, marks, list.
v3dctl(takes slate kendo-07 --scene 12 --take 3 --note "the sword slips" --dir ${WORK}/archive)
expect_status(0)
v3dctl(takes circle kendo-07 --dir ${WORK}/archive)
v3dctl(takes ${WORK}/archive)
expect("${out}" "^kendo-07 .* complete +verified +0:00 .* 4 cameras x +4 pulses, 25 Hz, 0 meshes  scene 12, take 3, circled, the sword slips\n$")
v3dctl(takes ${WORK}/archive --json)
expect("${out}" "\"verified\": true")
expect("${out}" "\"mark\": \"circled\"")
expect("${out}" "\"seconds\": 0.16")

# The timecode of a take with sound is in the list, its JSON, and what slate prints.
file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/timed)
set(sound "[[sound]]\nfile = 'sound/cap01.wav'\nnode = 'cap01'\nrate_hz = 48000\nchannels = 2\nsamples = 9\n")
string(APPEND sound "timecode_source = 'ltc'\ntimecode_rate = '29.97df'\n")
string(APPEND sound "first_timecode = '10:00:59;28'\nlast_timecode = '10:01:00;03'\n")
file(WRITE ${WORK}/timed/kendo-07/ledger.toml "${ledger}\n${sound}")
v3dctl(takes ${WORK}/timed)
expect("${out}" "^kendo-07 .* 25 Hz, 0 meshes, timecode 10:00:59;28 to 10:01:00;03\n$")
v3dctl(takes ${WORK}/timed --json)
expect("${out}" "\"timecode\": \"10:00:59;28 to 10:01:00;03\"")
v3dctl(takes slate kendo-07 --scene 12 --dir ${WORK}/timed)
expect("${out}" "timecode 10:00:59;28 to 10:01:00;03  scene 12\n$")
v3dctl(takes ${WORK}/archive --json)
if(out MATCHES "timecode")
  message(SEND_ERROR "a take without sound has a timecode: ${out}")
endif()

# A mesh file that cannot be read is listed with the cause, not as one without meshes.
file(WRITE ${WORK}/archive/kendo-07/mesh.v3d "")
v3dctl(takes ${WORK}/archive)
expect_status(0)
expect("${out}" "^kendo-07 .*25 Hz, mesh.v3d cannot be read  scene 12")
expect("${err}" "v3dctl: .*archive/kendo-07/mesh.v3d: is not a mesh file")
v3dctl(takes ${WORK}/archive --json)
expect("${out}" "\"meshes\": null")
expect("${out}" "\"mesh_error\": \".*archive/kendo-07/mesh.v3d: is not a mesh file")
file(REMOVE ${WORK}/archive/kendo-07/mesh.v3d)

# delete rejects a take without a copy, circled or unverified, and a command without --yes.
v3dctl(takes delete kendo-07 --yes --dir ${WORK}/archive)
expect_status(2)
expect("${err}" "read back first \\(--copy DIR\\), or say that none is needed \\(--no-copy\\)")
v3dctl(takes delete kendo-07 --no-copy --yes --dir ${WORK}/archive)
expect_status(2)
expect("${err}" "kendo-07 is circled: v3dctl takes clear kendo-07")
v3dctl(takes clear kendo-07 --dir ${WORK}/archive)
v3dctl(takes delete kendo-07 --no-copy --dir ${WORK}/archive)
expect_status(2)
expect("${err}" "would be deleted permanently; add --yes to delete them")
v3dctl(takes delete kendo-07 --copy ${WORK}/archive --yes --dir ${WORK}/cap01)
expect_status(2)
expect("${err}" "kendo-07 is not verified, or has changed since")
v3dctl(takes delete ../cap01 --no-copy --yes --dir ${WORK}/archive)
expect_status(2)

# A node's take is deleted only when its copy on the disk of the archive is identical.
v3dctl(verify ${WORK}/cap01/kendo-07 --json)
expect_status(0)
expect("${out}" "\"notes\": \\[\n +\"take.toml: is not named in the ledger\"")
set(plate ${WORK}/archive/kendo-07/background/cam01.mean.png)
file(COPY ${plate} DESTINATION ${WORK})
execute_process(COMMAND sh -c "printf X | dd of=${plate} bs=1 seek=500 conv=notrunc status=none && touch -r ${WORK}/cam01.mean.png ${plate}")
v3dctl(takes ${WORK}/archive)
expect("${out}" "verified")
v3dctl(takes delete kendo-07 --copy ${WORK}/archive --yes --dir ${WORK}/cap01)
expect_status(2)
expect("${err}" "background/cam01.mean.png: has [0-9,]+ bytes with the checksum")
expect("${err}" "kendo-07 is not deleted: its copy in .*archive is incomplete")
if(NOT EXISTS ${WORK}/cap01/kendo-07/cam01.lcmlog)
  message(SEND_ERROR "a take was deleted whose copy is damaged")
endif()
execute_process(COMMAND cp -p ${WORK}/cam01.mean.png ${plate})
# A take that was moved into this one is in no list: it is not deleted with it.
file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/inner)
file(RENAME ${WORK}/inner/kendo-07 ${WORK}/cap01/kendo-07/kendo-08)
v3dctl(verify ${WORK}/cap01/kendo-07 --json)
expect_status(0)
expect("${out}" "\"kendo-08/: is no folder of a take, and is not verified\"")
foreach(copy --no-copy "--copy;${WORK}/archive")
  v3dctl(takes delete kendo-07 ${copy} --yes --dir ${WORK}/cap01)
  expect_status(2)
  expect("${err}" "cannot delete [^\n]*cap01/kendo-07: it contains kendo-08/, which no verification and no copy includes")
  if(NOT EXISTS ${WORK}/cap01/kendo-07/kendo-08/cam01.lcmlog)
    message(SEND_ERROR "a take that was moved into another one was deleted with it")
  endif()
endforeach()
file(RENAME ${WORK}/cap01/kendo-07/kendo-08 ${WORK}/inner/kendo-08)
# Nor is one with a note that was written after it was collected. collect names it, too.
v3dctl(takes slate kendo-07 --note "use the second attack" --dir ${WORK}/cap01)
expect_status(0)
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(0)
expect("${out}" "^note: cap01/slate.toml: has \"use the second attack\", which the copy lacks; v3dctl takes slate writes it there\ntake kendo-07: exists already, complete, ")
v3dctl(takes delete kendo-07 --copy ${WORK}/archive --yes --dir ${WORK}/cap01)
expect_status(2)
expect("${err}" "kendo-07 is not deleted: the slate of its copy in [^\n]*archive lacks \"use the second attack\"; ")
v3dctl(takes slate kendo-07 --note "the sword slips" --dir ${WORK}/cap01)
v3dctl(takes delete kendo-07 --copy ${WORK}/archive --yes --dir ${WORK}/cap01)
expect_status(0)
if(EXISTS ${WORK}/cap01/kendo-07)
  message(SEND_ERROR "kendo-07 was not deleted on cap01")
endif()

# Without a copy, a take is deleted if it was verified since its last change.
execute_process(COMMAND sh -c "printf x >> ${WORK}/archive/kendo-07/cam01.lcmlog")
v3dctl(takes delete kendo-07 --no-copy --yes --dir ${WORK}/archive)
expect_status(2)
v3dctl(verify ${WORK}/archive/kendo-07)
expect_status(3)
v3dctl(takes ${WORK}/archive)
expect("${out}" " unverified ")
v3dctl(takes delete kendo-07 --no-copy --yes --dir ${WORK}/archive)
expect_status(0)
if(EXISTS ${WORK}/archive/kendo-07 OR EXISTS ${WORK}/archive/.deleted-kendo-07)
  message(SEND_ERROR "kendo-07 was not deleted")
endif()

# An interrupted deletion is no take; it is named, and finished on request or by the next deletion.
foreach(rest .deleted-kendo-05 .deleted-kendo-06)
  file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/archive)
  file(RENAME ${WORK}/archive/kendo-07 ${WORK}/archive/${rest})
endforeach()
v3dctl(takes ${WORK}/archive)
expect_status(0)
expect("${err}" "^v3dctl: the deletion of 2 takes was interrupted: kendo-05, kendo-06; to finish: v3dctl takes delete --yes\n$")
if(out)
  message(SEND_ERROR "an interrupted deletion is listed as a take: ${out}")
endif()
v3dctl(takes delete --dir ${WORK}/archive)
expect_status(2)
expect("${err}" "the deletion of 2 takes was interrupted: kendo-05, kendo-06; add --yes to finish")
v3dctl(takes delete --yes --dir ${WORK}/archive)
expect_status(0)
expect("${out}" "^finished the deletion of kendo-05\nfinished the deletion of kendo-06\n$")
file(GLOB rests LIST_DIRECTORIES true ${WORK}/archive/.deleted-*)
if(rests)
  message(SEND_ERROR "not deleted: ${rests}")
endif()
v3dctl(takes delete --yes --dir ${WORK}/archive)
expect_status(2)
expect("${err}" "takes delete: name the takes; .*archive has no interrupted deletion to finish")
foreach(take kendo-07 .deleted-kendo-06)
  file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/next)
  if(NOT take STREQUAL kendo-07)
    file(COPY ${WORK}/whole/kendo-07 DESTINATION ${WORK}/next/tmp)
    file(RENAME ${WORK}/next/tmp/kendo-07 ${WORK}/next/${take})
  endif()
endforeach()
v3dctl(verify ${WORK}/next/kendo-07)
v3dctl(takes delete kendo-07 --no-copy --yes --dir ${WORK}/next)
expect_status(0)
expect("${out}" "^deleted kendo-07\nfinished the deletion of kendo-06\n$")

# A take that is still being recorded is skipped.
string(REPLACE "'complete'" "'recording'" open_take "${of_cap01}")
file(WRITE ${WORK}/cap01/kendo-07/take.toml "${open_take}")
v3dctl(takes collect ${sources} --to ${WORK}/archive)
expect_status(3)
expect("${out}" "take kendo-07: not collected: cap01 records it")
file(REMOVE_RECURSE ${WORK})
