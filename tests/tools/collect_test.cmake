# Tests which takes takes collect finds, and when it collects none. Run by cmake -P with V3DCTL, V3D_SIM and WORK.
file(REMOVE_RECURSE ${WORK})

include(${CMAKE_CURRENT_LIST_DIR}/v3dctl_result.cmake)
function(expect_equal_files a b)
  execute_process(COMMAND cmp ${a} ${b} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
  expect_status(0)
endfunction()
# simulate(TAKE FRAMES): a take of two cameras.
function(simulate take frames)
  execute_process(COMMAND ${V3D_SIM} take ${take} --frames ${frames} --cameras 2 --size 64x48
    RESULT_VARIABLE status ERROR_VARIABLE err)
  expect_status(0)
endfunction()

# A take whose name another take in the archive has is not collected, and not reported as collected.
simulate(${WORK}/cap01/kendo-07 4)
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive)
expect_status(0)
file(RENAME ${WORK}/cap01 ${WORK}/monday)
simulate(${WORK}/cap01/kendo-07 5)
file(READ ${WORK}/cap01/kendo-07/take.toml info)
string(REGEX REPLACE "started_ns = 1([0-9])" "started_ns = 2\\1" thursday "${info}")
file(WRITE ${WORK}/cap01/kendo-07/take.toml "${thursday}")
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive)
expect_status(3)
expect("${out}" "^take kendo-07: not collected: ${WORK}/archive/kendo-07: is another take of this name, of [^\n]*; that of cap01 is of ")
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/archive --json)
expect_status(3)
expect("${out}" "\"collected\": false,[^}]*\"was_there\": true,[^}]*\"complete\": false")
expect_equal_files(${WORK}/archive/kendo-07/cam01.lcmlog ${WORK}/monday/kendo-07/cam01.lcmlog)
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/thursday)
expect_status(0)
# Nor is a take of which a node cannot be compared.
file(RENAME ${WORK}/cap01/kendo-07/take.toml ${WORK}/take.toml)
file(MAKE_DIRECTORY ${WORK}/cap01/kendo-07/take.toml)
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/thursday)
expect_status(3)
expect("${out}" "not collected: cannot read take.toml of cap01, to compare it with ")
file(REMOVE_RECURSE ${WORK}/cap01/kendo-07/take.toml)
file(RENAME ${WORK}/take.toml ${WORK}/cap01/kendo-07/take.toml)
# A node that has meshes only does not change the copy.
file(WRITE ${WORK}/recon01/kendo-07/mesh.v3d "meshes")
v3dctl(takes collect --from cap01=${WORK}/cap01 --from recon01=${WORK}/recon01 --to ${WORK}/thursday)
expect_status(0)
expect("${out}" "^take kendo-07: exists already, complete, 2 cameras x 5 pulses")
if(EXISTS ${WORK}/thursday/.collect)
  message(SEND_ERROR "something was left in .collect")
endif()

# The folder of takes of a node is no folder for its copies, by whatever path.
file(CREATE_LINK ${WORK}/cap01 ${WORK}/mounted SYMBOLIC)
v3dctl(takes collect --from cap01=${WORK}/cap01 --to ${WORK}/mounted)
expect_status(2)
expect("${err}" "--to ${WORK}/mounted: is the folder of takes of cap01 itself; ")
if(EXISTS ${WORK}/cap01/.collect)
  message(SEND_ERROR "something was left in .collect of a node")
endif()

# Folders that are no takes are named, and make no takes. A take behind a link is a take.
simulate(${WORK}/cap02/kendo-08 4)
simulate(${WORK}/elsewhere/kendo-11 4)
foreach(odd "old kendo-09" "für-01" ".deleted-kendo-10")
  file(WRITE "${WORK}/cap02/${odd}/take.toml" "")
endforeach()
file(CREATE_LINK ../elsewhere/kendo-11 ${WORK}/cap02/kendo-11 SYMBOLIC)
file(CREATE_LINK ../not-mounted/kendo-12 ${WORK}/cap02/kendo-12 SYMBOLIC)
execute_process(COMMAND sh -c "echo mix >\"$(printf '${WORK}/cap02/kendo-08/B\\374ro.txt')\"")
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/links)
expect_status(0)
expect("${out}" "note: cap02/B\\?ro.txt: is not copied, [^\n]*\ntake kendo-08: complete, [^\n]*\ntake kendo-11: complete, [^\n]*\n$")
expect("${err}" "note: cap02: 'old kendo-09' is no name of a take, and is not collected\n")
expect("${err}" "note: cap02: '[^\n]*-01' is no name of a take, and is not collected\n")
expect("${err}" "note: cap02: 'kendo-12' is a symbolic link to no folder, and is not collected; is its disk mounted\\?\n")
if(err MATCHES "deleted-kendo-10" OR "${out}${err}" MATCHES "kendo-09:")
  message(SEND_ERROR "a folder that is no take was collected, or an interrupted deletion is named: ${out}${err}")
endif()
expect_equal_files(${WORK}/links/kendo-11/cam02.lcmlog ${WORK}/elsewhere/kendo-11/cam02.lcmlog)
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/links kendo-11)
expect_status(0)
expect("${out}${err}" "^take kendo-11: exists already, complete, [^\n]*\n$")
# Names of files that are not UTF-8 end no JSON.
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/json kendo-08 --json)
expect_status(0)
expect("${out}" "\"notes\": \\[[^]]*\"cap02/B\\?ro.txt: is not copied")

# Footage without a take.toml is named by all.
file(COPY ${WORK}/cap02/kendo-08/cam01.lcmlog DESTINATION ${WORK}/cap05/kendo-14)
v3dctl(takes ${WORK}/cap05)
expect_status(3)
expect("${err}" "skipped: ${WORK}/cap05/kendo-14: has logs and no take.toml; ")
v3dctl(takes collect --from cap05=${WORK}/cap05 --to ${WORK}/lost)
expect_status(3)
expect("${out}" "^take kendo-14: not collected: cap05: kendo-14 has logs and no take.toml; a check of the file system ")
if(EXISTS ${WORK}/lost/.collect)
  message(SEND_ERROR "a take was copied that cannot be joined")
endif()

# A leftover that cannot be read does not end the command.
file(MAKE_DIRECTORY ${WORK}/loop/.collect)
file(CREATE_LINK kendo-08 ${WORK}/loop/.collect/kendo-08 SYMBOLIC)
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/loop)
expect_status(3)
expect("${out}" "^take kendo-08: not collected: [^\n]*Too many levels of symbolic links[^\n]*\ntake kendo-11: complete, ")

# A relative folder with a colon is no host.
execute_process(COMMAND ${V3DCTL} takes collect --from cap02=${WORK}/cap02 --to 2026-11-29T10:30 kendo-08
  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
expect_status(0)
expect_equal_files(${WORK}/cap02/kendo-08/cam01.lcmlog ${WORK}/2026-11-29T10:30/kendo-08/cam01.lcmlog)

# Two commands do not collect one take into one folder: the second is refused while the first copies.
file(MAKE_DIRECTORY ${WORK}/bin)
find_program(RSYNC rsync REQUIRED)
file(WRITE ${WORK}/bin/rsync "#!/bin/sh
case \" $* \" in *' --inplace '*)
  if [ ! -e ${WORK}/second ]; then
    PATH='$ENV{PATH}' ${V3DCTL} takes collect --from cap02=${WORK}/cap02 --to ${WORK}/shared kendo-08 >${WORK}/second
    echo \"status $?\" >>${WORK}/second
  fi
esac
exec ${RSYNC} \"$@\"
")
file(CHMOD ${WORK}/bin/rsync PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
set(path "$ENV{PATH}")
set(ENV{PATH} "${WORK}/bin:${path}")
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/shared kendo-08)
set(ENV{PATH} "${path}")
expect_status(0)
file(READ ${WORK}/second second)
expect("${second}" "^take kendo-08: not collected: cannot lock [^\n]*: process [0-9]+ on [^\n]* has locked it\nstatus 3\n$")
if(EXISTS ${WORK}/shared/.collect OR NOT EXISTS ${WORK}/shared/kendo-08/take.toml)
  message(SEND_ERROR "the first command did not collect its take, or left something in .collect")
endif()

# Sound without a checksum in the ledger, as above 4 GiB, is compared with that of the node: a wrong byte in the copy is found.
simulate(${WORK}/cap06/kendo-15 4)
file(WRITE ${WORK}/cap06/kendo-15/sound/cap06.raw "sound of hours")
file(READ ${WORK}/cap06/kendo-15/ledger.toml ledger)
string(REGEX REPLACE "^xxh3 = '[0-9a-f]+'\n" "" ledger "${ledger}")
string(APPEND ledger "\n[[file]]\nname = 'sound/cap06.raw'\nbytes = 14\n")
file(WRITE ${WORK}/cap06/kendo-15/ledger.toml "${ledger}")
file(WRITE ${WORK}/damaging/rsync "#!/bin/sh
${RSYNC} \"$@\" || exit
case \" $* \" in *' --inplace '*)
  printf X | dd of=${WORK}/sounds/.collect/kendo-15/cap06/sound/cap06.raw bs=1 seek=3 conv=notrunc status=none
esac
")
file(CHMOD ${WORK}/damaging/rsync PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
set(ENV{PATH} "${WORK}/damaging:${path}")
v3dctl(takes collect --from cap06=${WORK}/cap06 --to ${WORK}/sounds)
set(ENV{PATH} "${path}")
expect_status(3)
expect("${out}" "^take kendo-15: not collected: the copy differs from the files of the nodes; ")
if(EXISTS ${WORK}/sounds/kendo-15)
  message(SEND_ERROR "a copy with a wrong byte was collected")
endif()
v3dctl(takes collect --from cap06=${WORK}/cap06 --to ${WORK}/sounds)
expect_status(0)
expect_equal_files(${WORK}/sounds/kendo-15/sound/cap06.raw ${WORK}/cap06/kendo-15/sound/cap06.raw)

# A part in .collect whose files are also those of a collected take: this take is not changed.
file(MAKE_DIRECTORY ${WORK}/shared/.collect/kendo-08/cap02)
execute_process(COMMAND cp -al ${WORK}/shared/kendo-08/. ${WORK}/shared/.collect/kendo-08/cap02)
file(MAKE_DIRECTORY ${WORK}/shared/best)
file(RENAME ${WORK}/shared/kendo-08 ${WORK}/shared/best/kendo-08)
file(COPY ${WORK}/cap02/kendo-08/cam01.lcmlog DESTINATION ${WORK}/intact)
execute_process(COMMAND sh -c "printf X | dd of=${WORK}/cap02/kendo-08/cam01.lcmlog bs=1 seek=2000 conv=notrunc status=none")
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/shared kendo-08)
expect_status(3)
expect_equal_files(${WORK}/shared/best/kendo-08/cam01.lcmlog ${WORK}/intact/cam01.lcmlog)
expect_equal_files(${WORK}/shared/kendo-08/cam01.lcmlog ${WORK}/cap02/kendo-08/cam01.lcmlog)
file(COPY ${WORK}/intact/cam01.lcmlog DESTINATION ${WORK}/cap02/kendo-08)

# A recovered take is not collected while a daemon, which may continue it, has its lock. A copy that was made before the node
# continued the take is not reported as collected.
simulate(${WORK}/cap04/kendo-13 4)
file(READ ${WORK}/cap04/kendo-13/take.toml info)
string(REPLACE "'complete'" "'recovered'" recovered "${info}")
file(WRITE ${WORK}/cap04/kendo-13/take.toml "${recovered}")
file(WRITE ${WORK}/cap04/kendo-13/.cap04.lock "process 812 on cap04\n")
v3dctl(takes collect --from cap04=${WORK}/cap04 --to ${WORK}/nightly)
expect_status(3)
expect("${out}" "^take kendo-13: not collected: process 812 on cap04 has locked it on cap04, and may continue it; [^\n]*remove .cap04.lock there\n$")
file(REMOVE ${WORK}/cap04/kendo-13/.cap04.lock)
v3dctl(takes collect --from cap04=${WORK}/cap04 --to ${WORK}/nightly)
if(NOT EXISTS ${WORK}/nightly/kendo-13/cam01.lcmlog)
  message(SEND_ERROR "a recovered take without a lock was not collected: ${out}${err}")
endif()
file(READ ${WORK}/cap04/kendo-13/ledger.toml ledger)
string(REGEX REPLACE "^xxh3 = '[0-9a-f]+'\n" "" ledger "${ledger}")
string(APPEND ledger "\n[[file]]\nname = 'cam01.0001.lcmlog'\nbytes = 7\nxxh3 = '0123456789abcdef'\n")
file(WRITE ${WORK}/cap04/kendo-13/ledger.toml "${ledger}")
v3dctl(takes collect --from cap04=${WORK}/cap04 --to ${WORK}/nightly)
expect_status(3)
expect("${out}" "^take kendo-13: not collected: ${WORK}/nightly/kendo-13: is a copy from before cap04 continued or recovered the take: lacks cam01.0001.lcmlog; move it ")

# A folder in the place of the copy is reported before anything is copied.
file(WRITE ${WORK}/occupied/kendo-08/notes.txt "")
v3dctl(takes collect --from cap02=${WORK}/cap02 --to ${WORK}/occupied kendo-08)
expect_status(3)
expect("${out}" "not collected: ${WORK}/occupied/kendo-08: exists, and has no take.toml; move it out of the folder\n$")
if(EXISTS ${WORK}/occupied/.collect)
  message(SEND_ERROR "a take was copied that has no place")
endif()

if(NOT FAULT_INJECTOR)
  return()
endif()
# Without hard links a take is copied when it is joined. One that would fill the disk is refused before it is copied.
file(MAKE_DIRECTORY ${WORK}/exfat ${WORK}/cap03)
file(COPY ${WORK}/cap02/kendo-08 DESTINATION ${WORK}/cap03)
execute_process(COMMAND truncate -s 65536 ${WORK}/report)
set(no_links ${CMAKE_COMMAND} -E env LD_PRELOAD=${FAULT_INJECTOR} V3D_FAULT_PROGRAM=v3dctl V3D_FAULT_PREFIX=${WORK}/exfat
  V3D_FAULT_REPORT=${WORK}/report V3D_FAULT_CALL=link V3D_FAULT_NUMBER=1 V3D_FAULT_LASTS=1 V3D_FAULT_KIND=EIO)
set(collect ${V3DCTL} takes collect --from cap03=${WORK}/cap03 --to ${WORK}/exfat)
execute_process(COMMAND ${no_links} ${collect} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
expect_status(0)
expect_equal_files(${WORK}/exfat/kendo-08/cam02.lcmlog ${WORK}/cap02/kendo-08/cam02.lcmlog)
file(REMOVE_RECURSE ${WORK}/exfat/kendo-08)
foreach(camera 5 6 7 8)
  execute_process(COMMAND truncate -s 15T ${WORK}/cap03/kendo-08/cam0${camera}.lcmlog)
endforeach()
# This rsync copies no frames: the files would fill the disk of the test.
file(WRITE ${WORK}/bin/rsync "#!/bin/sh
case \" $* \" in *' --inplace '*) exit 99 ;; esac
exec ${RSYNC} \"$@\"
")
set(ENV{PATH} "${WORK}/bin:${path}")
execute_process(COMMAND ${no_links} ${collect} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
set(ENV{PATH} "${path}")
file(REMOVE_RECURSE ${WORK}/cap03)
expect_status(3)
expect("${out}" "not collected: ${WORK}/exfat: its file system has no hard links, so [^\n]* 13[12][0-9.]* TB more; [0-9.]+ [kMGTP]*B are free; [^\n]*\n$")
file(REMOVE_RECURSE ${WORK})
