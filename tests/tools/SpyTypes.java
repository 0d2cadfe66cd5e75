// Exits with 0 when lcm-spy's own catalogue, made of the class path, knows every type that is named.
import lcm.spy.LCMTypeDatabase;

public class SpyTypes {
  public static void main(String[] names) throws Exception {
    LCMTypeDatabase database = new LCMTypeDatabase();
    for (String name : names) {
      long fingerprint = Class.forName(name).getField("LCM_FINGERPRINT").getLong(null);
      Class<?> found = database.getClassByFingerprint(fingerprint);
      if (found == null || !found.getName().equals(name)) {
        System.err.println("lcm-spy does not know " + name);
        System.exit(1);
      }
    }
    System.exit(names.length > 0 ? 0 : 1);
  }
}
