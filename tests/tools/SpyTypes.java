// Exits with 0 when lcm-spy's type database, made from the class path, finds every named type and decodes
// a message of it that is followed by a MAC.
import java.io.ByteArrayOutputStream;
import java.io.DataOutputStream;
import java.lang.reflect.Array;
import java.lang.reflect.Field;
import lcm.lcm.LCMEncodable;
import lcm.spy.LCMTypeDatabase;

public class SpyTypes {
  private static final int MAC_SIZE = 32;

  public static void main(String[] names) throws Exception {
    LCMTypeDatabase database = new LCMTypeDatabase();
    for (String name : names) {
      Class<?> type = Class.forName(name);
      Class<?> found = database.getClassByFingerprint(type.getField("LCM_FINGERPRINT").getLong(null));
      if (found == null || !found.getName().equals(name)) {
        System.err.println("lcm-spy does not find the type " + name);
        System.exit(1);
      }
      found.getConstructor(byte[].class).newInstance((Object) with_mac(found));
    }
    System.exit(names.length > 0 ? 0 : 1);
  }

  private static LCMEncodable example(Class<?> type) throws Exception {
    LCMEncodable message = (LCMEncodable) type.getConstructor().newInstance();
    for (Field field : type.getFields()) {
      if (field.getType() == String.class) field.set(message, "cap01");
      if (LCMEncodable.class.isAssignableFrom(field.getType())) field.set(message, example(field.getType()));
      if (field.getType().isArray() && field.get(message) == null) {
        field.set(message, Array.newInstance(field.getType().getComponentType(), 0));
      }
    }
    return message;
  }

  private static byte[] with_mac(Class<?> type) throws Exception {
    ByteArrayOutputStream bytes = new ByteArrayOutputStream();
    example(type).encode(new DataOutputStream(bytes));
    bytes.write(new byte[MAC_SIZE]);
    return bytes.toByteArray();
  }
}
